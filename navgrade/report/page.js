"use strict";

const figures = JSON.parse(document.getElementById("figures").textContent);
const root = document.documentElement;
const dark = matchMedia("(prefers-color-scheme: dark)");
const touch = matchMedia("(pointer: coarse)").matches;
const hidden = new Set();
const plots = Object.entries(figures).map(([id, figure]) => ({
  node: document.getElementById(id),
  figure,
  view: figure.views[figure.first],
  turn: 0,
}));
const config = {
  responsive: true,
  displaylogo: false,
  modeBarButtons: [["zoom2d", "pan2d", "resetScale2d", "toImage"]],
  toImageButtonOptions: { scale: 3 },
};

function draw(plot) {
  const css = getComputedStyle(root);
  const ink = css.getPropertyValue("--ink");
  const line = css.getPropertyValue("--line");
  const layout = { ...plot.figure.layout, ...plot.view.layout };
  const axis = { gridcolor: line, linecolor: line, zerolinecolor: line, automargin: true };
  const soft = css.getPropertyValue("--soft");
  const small = { size: 12, color: soft };
  const guide = { color: soft, width: 1, dash: "dot" };
  const traces = (plot.view.data ?? plot.figure.data).map((trace) => ({
    ...trace,
    marker: { color: ink, ...trace.marker },
    visible: !hidden.has(trace.meta),
  }));
  return Plotly.react(plot.node, traces, {
    ...layout,
    autosize: true,
    showlegend: false,
    dragmode: touch ? false : "zoom",
    uirevision: plot.turn,
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    font: { family: css.fontFamily, size: innerWidth < 600 ? 11 : 13, color: ink },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: soft, activecolor: ink },
    hoverlabel: { align: "left", font: { size: 13 } },
    xaxis: { ...axis, ...layout.xaxis },
    yaxis: { ...axis, ...layout.yaxis },
    shapes: (layout.shapes ?? []).map((shape) => ({ line: guide, ...shape })),
    annotations: (layout.annotations ?? []).map((note) => ({ font: small, ...note })),
  }, config);
}

/** Lay a bar of a round length along the lower edge of the map. */
function scale(node) {
  const [west, east] = node.layout.xaxis.range;
  const decade = 10 ** Math.floor(Math.log10((east - west) / 4));
  const length = decade * [5, 2, 1].find((step) => step * decade <= (east - west) / 4);
  const from = west + 0.04 * (east - west);
  const label = length < 1000 ? `${+length.toPrecision(1)} m` : `${length / 1000} km`;
  if (node.scaleBar === `${from} ${label}`) return;
  node.scaleBar = `${from} ${label}`;
  const ink = getComputedStyle(root).getPropertyValue("--ink");
  Plotly.relayout(node, {
    shapes: [{
      type: "line", yref: "paper", x0: from, x1: from + length, y0: 0.05, y1: 0.05,
      line: { color: ink, width: 4 },
    }],
    annotations: [{
      x: from + length / 2, yref: "paper", y: 0.055, yanchor: "bottom", text: label,
      showarrow: false, font: { color: ink, size: 13 },
    }],
  });
}

async function drawAll() {
  for (const plot of plots) {
    await draw(plot);
    if (plot.node.id === "track") {
      plot.node.scaleBar = "";
      scale(plot.node);
    }
  }
}

function choose(group, index) {
  for (const plot of plots.filter((plot) => plot.node.id === group)) {
    plot.view = plot.figure.views[index];
    plot.turn += 1;
  }
  for (const pane of document.querySelectorAll(`[data-pane="${group}"]`)) {
    pane.classList.toggle("shown", pane.dataset.view === index);
  }
}

root.classList.add("live");
for (const input of document.querySelectorAll(".switch input")) {
  if (input.checked) choose(input.name, input.value);
  input.addEventListener("change", () => {
    choose(input.name, input.value);
    drawAll();
  });
}
for (const input of document.querySelectorAll(".legend input")) {
  input.addEventListener("change", () => {
    hidden[input.checked ? "delete" : "add"](input.value);
    drawAll();
  });
  if (!input.checked) hidden.add(input.value);
}
dark.addEventListener("change", drawAll);
addEventListener("beforeprint", () => {
  root.classList.add("paper");
  drawAll();
  for (const { node } of plots) Plotly.relayout(node, { width: 690 });
});
addEventListener("afterprint", () => {
  root.classList.remove("paper");
  for (const { node } of plots) Plotly.relayout(node, { width: null, autosize: true });
  drawAll();
});
drawAll().then(() => {
  const map = document.getElementById("track");
  map.on("plotly_relayout", () => scale(map));
  root.dataset.drawn = "yes";
});
