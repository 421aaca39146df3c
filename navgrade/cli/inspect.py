"""navgrade inspect"""

from __future__ import annotations

import json
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import click
from rich.table import Table
from rich.text import Text

from navgrade.cli.options import log_argument
from navgrade.cli.terminal import console, progress_bar, row
from navgrade.logs import Issue
from navgrade.logs.audit import LogAudit, TopicAudit, audit
from navgrade.logs.stamps import Places, StampAudit

_LISTED = 5


@click.command("inspect")
@log_argument
@click.option("--deep", is_flag=True, help="Read every message and find every defect.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(log: str | Path, deep: bool, as_json: bool) -> None:
    """Report what LOG holds, which topic is the IMU, and what is wrong.

    Takes the summary at the end of the file and the first and last messages of each topic. A file
    whose summary does not suffice is read whole.
    """
    with progress_bar("reading", log) as progress:
        found = audit(log, deep=deep, progress=progress)
    if as_json:
        click.echo(json.dumps(found.report(), indent=2))
        return
    _show_file(found)
    _show_topics(found)
    _show_imus(found)
    _show_defects(found)
    _show_records(found)


def _show_file(found: LogAudit) -> None:
    written = " ".join(part for part in (found.profile, found.library) if part)
    console.print(f"{found.name}  {_bytes(found.size)}  {written}", markup=False)
    if found.log_span_ns:
        first_ns, last_ns = found.log_span_ns
        row("log time", f"from {_utc(first_ns)} UTC on, {(last_ns - first_ns) * 1e-9:.3f} s")
    if found.chunks:
        chunks = found.chunks
        ratio = f", {chunks.size / chunks.stored:.1f} to 1" if chunks.stored else ""
        row(
            "chunks",
            f"{chunks.count}, {', '.join(chunks.compressions)}, {_bytes(chunks.size)} in "
            f"{_bytes(chunks.stored)}{ratio}",
        )
    if found.why_deep:
        row("read", f"whole: {found.why_deep}")
    elif found.deep:
        row("read", "whole")
    else:
        row("read", "its summary, and the ends of each topic; --deep reads all")


def _bytes(size: int) -> str:
    for unit, factor in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if size >= factor:
            return f"{size / factor:.1f} {unit}"
    return f"{size} bytes"


def _utc(time_ns: int) -> str:
    seconds, rest = divmod(time_ns, 1_000_000_000)
    try:
        return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%d %H:%M:%S}.{rest // 1_000_000:03d}"
    except (ValueError, OverflowError, OSError):  # far from any calendar
        return f"{time_ns} ns"


def _show_topics(found: LogAudit) -> None:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column("topic", overflow="fold")
    for name in ("messages", "rate Hz", "from s", "to s"):
        table.add_column(name, justify="right", no_wrap=True)
    begin_ns, _ = found.log_span_ns or (0, 0)
    for topic in found.topics:
        kind = " ".join(part for part in (topic.schema, topic.encoding) if part)
        cells = [str(topic.count), f"{topic.rate_hz:.4g}" if topic.rate_hz else "-"]
        for time_ns in (topic.first_log_ns, topic.last_log_ns):
            cells.append("-" if time_ns is None else f"{(time_ns - begin_ns) * 1e-9:.3f}")
        table.add_row(Text.assemble(topic.name, (f"\n  {kind}", "dim")), *cells)
    console.print()
    console.print(table, soft_wrap=False)


def _show_imus(found: LogAudit) -> None:
    """Which topic a run takes, and what must be said about each."""
    console.print()
    choices = found.imu_choices
    taken = f"{choices[0]}, the only one" if len(choices) == 1 else "say which (--imu-topic)"
    row("IMU topic", taken if choices else "none of a known type, unless [imu.fields] tells more")
    for use in found.imus:
        console.print(f"  {use.topic}", markup=False)
        kind = f"kind {use.default_kind}" if use.default_kind else "kind to be said (--kind)"
        console.print(f"    {kind}, axes {use.axes} unless said", markup=False)
        if use.accel_schema:
            console.print(f"    with a topic of {use.accel_schema} (imu.accel_topic)", markup=False)
        if use.warning:
            console.print(f"    {use.warning}", style="yellow", markup=False)


def _defect(where: str, text: str) -> None:
    console.print(f"{where}: {text}", style="yellow", markup=False)


def _show_defects(found: LogAudit) -> None:
    lines = [(topic.name, text) for topic in found.topics for text in _defects(topic)]
    lines += [("file", _issue(issue)) for issue in found.issues]
    if lines:
        console.print()
    for where, text in lines:
        _defect(where, text)


def _issue(issue: Issue) -> str:
    lost = "" if issue.messages is None else f", {issue.messages} messages lost"
    span = ""
    if issue.start_ns is not None and issue.end_ns is not None:
        span = f", log time {_utc(issue.start_ns)} to {_utc(issue.end_ns)}"
    return f"{issue.text} (byte {issue.offset}{lost}{span})"


def _defects(topic: TopicAudit) -> Iterator[str]:
    if topic.trouble:
        yield f"its messages cannot be decoded: {topic.trouble}"
    if topic.not_finite.count:
        at = ", ".join(f"{at:.3f} s" for at, _ in topic.not_finite.first[:_LISTED])
        yield f"{topic.not_finite.count} messages with a number that is not finite: {at}"
    if topic.sequence.skipped:
        yield f"{topic.sequence.skipped} sequence numbers skipped: messages were lost"
    if topic.sequence.steps_back:
        yield f"{topic.sequence.steps_back} backward steps of the sequence number"
    if topic.sequence.wraps:
        yield f"{topic.sequence.wraps} wraps of the sequence number"
    if topic.stamps is None:
        return
    yield from _stamp_defects(topic.stamps)
    ratio = topic.clock_ratio
    if ratio is not None and not 0.99 < ratio < 1.01:
        name = topic.stamps.name
        yield f"the {name} spans {ratio:.4g} times the log time; navigation uses the {name}"


def _stamp_defects(stamps: StampAudit) -> Iterator[str]:
    name = stamps.name
    if stamps.repeats:
        equal = stamps.exact_repeats
        exact = "" if equal is None else f", {equal} of them in messages that are equal altogether"
        yield f"{stamps.repeats} repeats of the {name}{exact}"
    for places, what in (
        (stamps.backward_steps, f"backward steps of the {name}"),
        (stamps.gaps, "gaps longer than 3 intervals"),
        (stamps.jumps, f"jumps of the {name} without log time, a clock was set"),
        (stamps.wraps, f"wraps of the counter behind the {name}"),
    ):
        if places.count:
            yield f"{places.count} {what}: {_listed(places)}"
    low, high = stamps.log_minus_stamp
    if high - low > 10.0 * (stamps.interval or high):
        yield f"log time minus {name} runs from {low:.6f} s to {high:.6f} s"


def _listed(places: Places) -> str:
    """The first ones, and that there are more."""
    listed = ", ".join(f"{length:.3f} s at {at:.3f} s" for at, length in places.first[:_LISTED])
    return listed + (", …" if places.count > _LISTED else "")


def _show_records(found: LogAudit) -> None:
    for name, values in found.metadata:
        console.print(f"\nmetadata {name}", style="bold", markup=False)
        for key, value in values.items():
            console.print(f"  {key}: {value}".replace("\n", "\n    "), markup=False)
    for name, media_type, size in found.attachments:
        console.print(f"\nattachment {name}, {media_type}, {size} bytes", markup=False)
