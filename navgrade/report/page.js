"use strict";

const figures = JSON.parse(document.getElementById("figures").textContent);
const root = document.documentElement;
const map = document.getElementById("track");
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

async function draw(plot) {
  const css = getComputedStyle(root);
  const ink = css.getPropertyValue("--ink");
  const line = css.getPropertyValue("--line");
  // a copy: plotly writes a zoom into what it was given
  const layout = structuredClone({ ...plot.figure.layout, ...plot.view.layout });
  const axis = { gridcolor: line, linecolor: line, zerolinecolor: line, automargin: true };
  const names = ["xaxis", "yaxis", "yaxis2"].filter((name) => name !== "yaxis2" || layout[name]);
  const axes = Object.fromEntries(names.map((name) => [name, { ...axis, ...layout[name] }]));
  const soft = css.getPropertyValue("--soft");
  const small = { size: 12, color: soft };
  const guide = { color: soft, width: 1, dash: "dot" };
  const traces = (plot.view.data ?? plot.figure.data).map((trace) => ({
    ...trace,
    marker: { color: ink, ...trace.marker },
    visible: !hidden.has(trace.meta),
  }));
  await Plotly.react(plot.node, traces, {
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
    ...axes,
    shapes: (layout.shapes ?? []).map((shape) => ({ line: guide, ...shape })),
    annotations: (layout.annotations ?? []).map((note) => ({ font: small, ...note })),
  }, config);
  if (plot.node === map) {
    map.scaleBar = null;
    scale();
  }
}

/** Lay a bar of a round length along the lower edge of the map; on paper, lest it widen the map. */
function scale() {
  const [west, east] = map.layout.xaxis.range;
  const decade = 10 ** Math.floor(Math.log10((east - west) / 4));
  const length = decade * [5, 2, 1].find((step) => step * decade <= (east - west) / 4);
  const share = length / (east - west);
  if (map.scaleBar === share) return;
  map.scaleBar = share;
  const ink = getComputedStyle(root).getPropertyValue("--ink");
  const onPaper = { xref: "paper", yref: "paper" };
  Plotly.relayout(map, {
    shapes: [{
      ...onPaper, type: "line", x0: 0.04, x1: 0.04 + share, y0: 0.05, y1: 0.05,
      line: { color: ink, width: 4 },
    }],
    annotations: [{
      ...onPaper, x: 0.04 + share / 2, y: 0.055, xanchor: "center", yanchor: "bottom",
      text: length < 1000 ? `${+length.toPrecision(1)} m` : `${length / 1000} km`,
      showarrow: false, font: { color: ink, size: 13 },
    }],
  });
}

const drawAll = () => Promise.all(plots.map(draw));

/** Take up the view a button stands for; the plot, where it is one of a plot. */
function choose({ name, value }) {
  for (const pane of document.querySelectorAll(`[data-pane="${name}"]`)) {
    pane.classList.toggle("shown", pane.dataset.view === value);
  }
  const plot = plots.find((plot) => plot.node.id === name);
  if (plot) {
    plot.view = plot.figure.views[value];
    plot.turn += 1;
  }
  return plot;
}

root.classList.add("live");
for (const input of document.querySelectorAll(".switch input")) {
  if (input.checked) choose(input);
  input.addEventListener("change", () => {
    const plot = choose(input);
    if (plot) draw(plot);
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
  for (const { node } of plots) {
    const height = node.classList.contains("bars") ? node.clientHeight : 340;
    Plotly.relayout(node, { width: 690, height });
  }
});
addEventListener("afterprint", () => {
  root.classList.remove("paper");
  for (const { node } of plots) Plotly.relayout(node, { width: null, height: null, autosize: true });
  drawAll();
});
drawAll().then(() => {
  map?.on("plotly_relayout", scale);
  root.dataset.drawn = "yes";
});
