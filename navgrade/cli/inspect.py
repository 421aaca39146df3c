"""navgrade inspect"""

from __future__ import annotations

from pathlib import Path

import click

from navgrade.cli.options import log_argument
from navgrade.cli.show import console
from navgrade.logs.audit import TopicAudit, audit


@click.command("inspect")
@log_argument
def command(log: Path) -> None:
    """Read LOG and report its topics, schemas, rates, spans and time defects."""
    report = audit(log)
    rows = [("topic", "schema", "messages", "rate Hz", "header span s", "log span s")]
    rows += [
        (
            topic.name,
            topic.schema or topic.encoding,
            str(topic.count),
            f"{topic.rate_hz:.4g}",
            "-" if topic.stamp_span is None else f"{topic.stamp_span:.3f}",
            f"{topic.log_span:.3f}",
        )
        for topic in report.topics
    ]
    widths = [max(len(cells[i]) for cells in rows) for i in range(6)]
    for cells in rows:
        left = (f"{cell:<{width}}" for cell, width in zip(cells[:2], widths[:2], strict=True))
        right = (f"{cell:>{width}}" for cell, width in zip(cells[2:], widths[2:], strict=True))
        console.print("  ".join((*left, *right)), markup=False)
    for topic in report.topics:
        for line in _defects(topic):
            console.print(f"{topic.name}: {line}", style="yellow", markup=False)
    for issue in report.issues:
        console.print(f"file: {issue.text} (byte {issue.offset})", style="yellow", markup=False)
    for name, values in report.metadata.items():
        console.print(f"\nmetadata {name}", style="bold", markup=False)
        for key, value in values.items():
            console.print(f"  {key}: {value}", markup=False)
    for name, media_type, size in report.attachments:
        console.print(f"\nattachment {name}, {media_type}, {size} bytes", markup=False)


def _defects(topic: TopicAudit) -> list[str]:
    lines = []
    if topic.repeats:
        lines.append(f"{topic.repeats} repeated header stamps")
    if topic.backward_steps:
        lines.append(f"{topic.backward_steps} backward steps of the header stamp")
    if topic.gap_count:
        listed = ", ".join(f"{length:.3f} s at {start:.3f} s" for start, length in topic.gaps)
        more = ", …" if topic.gap_count > len(topic.gaps) else ""
        lines.append(f"{topic.gap_count} gaps longer than 3 intervals: {listed}{more}")
    ratio = topic.clock_ratio
    if ratio is not None and not 0.99 < ratio < 1.01:
        lines.append(
            f"header stamps span {ratio:.4g} times the log time; navigation uses header stamps"
        )
    if topic.log_minus_stamp is not None:
        low, high = topic.log_minus_stamp
        if high - low > 10.0 * (topic.interval or high):
            lines.append(f"log time minus header stamp runs from {low:.6f} s to {high:.6f} s")
    return lines
