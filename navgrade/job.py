"""The main job: from a log and a site file to an aligned solution, in bounded memory."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path

import numpy as np

from earth import gravity as earth_gravity
from earth.disturbance import DisturbanceGrid
from earth.gravity import GRAVITY_MODELS
from navgrade import mechanization as frames
from navgrade import reconstruction as body
from navgrade.alignment import AlignedWindow, align_log, alignment_report, check_units
from navgrade.errors import ConfigError, GapError, LogError, StateTimeError
from navgrade.gaps import Gap
from navgrade.imu import ImuSamples, Status, concatenate
from navgrade.logs import (
    POSE_RATE,
    PROVENANCE,
    ImuLog,
    Issue,
    SolutionWriter,
    TopicCopy,
    check_output,
    open_imu,
    read_heights,
    sha256,
)
from navgrade.navigation import FRAMES, check_choice, choose, solve
from navgrade.site import BaroSettings, Initial, Site
from navgrade.state import NavState, Trajectory
from navgrade.vertical import BaroLoop

_AT_REST = 0.1  # m/s: slower, an initial state is a stop, and units can be checked
_CHECK_SPAN = 2.0  # s of samples for that check

Progress = Callable[[int], None]


@dataclass(frozen=True)
class Choices:
    """What the command line may set over the site file; None leaves it to the file."""

    topic: str | None = None
    kind: str | None = None
    axes: str | None = None
    reconstruction: str | None = None
    frame: str | None = None
    vertical: str | None = None
    gravity: str | None = None
    bridge_gaps: bool = False
    strict: bool = False


@dataclass
class RunSummary:
    """What a run did.

    Attributes
    ----------
    samples : int
        Rows of the solution: integrated samples, or groups of N with ``samples-N``.
    duration : float
        s.
    gaps : list of Gap
        Bridged.
    issues : list of str
        Defects of the file.
    notes : list of str
        What the reading met, see `ImuLog.notes`, and was not known when the log was opened.
    counts : dict of str to int
        Samples per status bit.
    seconds : float
        Wall time of reading, navigating and writing.
    """

    output: Path
    log: ImuLog
    alignment: AlignedWindow | None
    reconstruction: str
    frame: str
    vertical: str
    gravity: str
    first: NavState
    final: NavState | None = None
    samples: int = 0
    duration: float = 0.0
    gaps: list[Gap] = field(default_factory=list)
    issues: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)
    seconds: float = 0.0


def open_log(path: str | Path, site: Site, choices: Choices) -> ImuLog:
    """Open the IMU topic the site file and the command line name."""
    return open_imu(
        path,
        choices.topic or site.topic,
        choices.kind or site.kind,
        choices.axes or site.axes,
        strict=choices.strict,
        gyro_unit=site.gyro_unit,
        accel_unit=site.accel_unit,
        dv_frame=site.dv_frame or "start",
        rate_hz=site.rate_hz,
        accel_topic=site.accel_topic,
        fields=site.fields,
    )


def _initial_state(log: ImuLog, initial: Initial) -> NavState:
    """The known state on the log's clock, after a look at the units where it stands still."""
    state = initial.state
    t = (initial.time_ns - log.epoch_ns) * 1e-9
    if float(np.linalg.norm(state.v_eb_n)) < _AT_REST and abs(t) < _CHECK_SPAN:
        head: list[ImuSamples] = []
        for block in log.blocks():
            head.append(block)
            if block.t[-1] > _CHECK_SPAN:
                break
        samples = concatenate(head)
        samples = samples[: max(int(np.searchsorted(samples.t, _CHECK_SPAN)), 2)]
        check_units(samples, state.lat)
    return NavState(
        lat=state.lat, lon=state.lon, h=state.h, v_eb_n=state.v_eb_n, q_nb=state.q_nb, t=t
    )


def starting_state(log: ImuLog, site: Site) -> tuple[NavState, AlignedWindow | None]:
    """The state a run starts from: the site file's, or that of the alignment.

    Raises
    ------
    ConfigError, AlignmentError
        See `align_log`.
    """
    if site.initial is not None:
        return _initial_state(log, site.initial), None
    aligned = align_log(log, site, leave_rest=True)
    if aligned.state is None:
        raise ConfigError(
            "navigation needs a heading, and method level finds none",
            file=site.file,
            key="alignment.method",
        )
    return aligned.state, aligned


def run(
    log: ImuLog,
    site: Site,
    output: str | Path,
    choices: Choices | None = None,
    *,
    rate_hz: float | None = None,
    pose_rate_hz: float = POSE_RATE,
    location_fix: bool = False,
    copy_topics: Sequence[str] = (),
    overwrite: bool = False,
    progress: Progress | None = None,
    aligned: Callable[[AlignedWindow], None] | None = None,
) -> RunSummary:
    """Align, navigate and write, streaming from file to file.

    Parameters
    ----------
    log : ImuLog
        From `open_log`.
    site : Site
    output : path
        Appears when it is complete.
    choices : Choices, optional
    rate_hz : float, optional
        Output rate; every sample by default.
    pose_rate_hz : float
        Of odometry and transforms, at most; 0 leaves them out.
    location_fix : bool
        Write fixes in Foxglove's own message, too.
    copy_topics : sequence of str
        Topics of the log that are carried over.
    overwrite : bool
    progress : callable, optional
        Called with bytes of the log read.
    aligned : callable, optional
        Called with the alignment before navigation starts.

    Raises
    ------
    NavgradeError
        On anything that prevents a solution; `output` then does not appear.
    """
    choices = choices or Choices()
    output = Path(output)
    known = log.notes
    began = time.perf_counter()
    frame = setting("frame", choices, site, FRAMES, frames.DEFAULT)
    own = FRAMES[frame].reconstruction or body.DEFAULT
    reconstruction = setting("reconstruction", choices, site, body.RECONSTRUCTIONS, own)
    vertical = setting("vertical", choices, site, frames.VERTICAL, "free")
    try:
        choose(reconstruction, frame, vertical)
        body.check_input(reconstruction, log.kind)
    except ValueError as error:
        raise ConfigError(str(error), key="mechanization") from None
    gravity = setting("gravity", choices, site, GRAVITY_MODELS, earth_gravity.DEFAULT)
    disturbance = _disturbance(site)
    if rate_hz is not None and not (np.isfinite(rate_hz) and rate_hz > 0.0):
        raise ConfigError(f"the output rate must be positive, got {rate_hz!r} Hz")
    if not (np.isfinite(pose_rate_hz) and pose_rate_hz >= 0.0):
        raise ConfigError(f"the pose rate must be positive, or 0 for none, got {pose_rate_hz!r} Hz")
    if output.exists() and isinstance(log.path, Path) and output.samefile(log.path):
        raise ConfigError(f"the output {output} is the input log")
    check_output(output, overwrite=overwrite)
    copy = TopicCopy(log.path, copy_topics, strict=choices.strict) if copy_topics else None
    state, alignment = starting_state(log, site)
    if alignment is not None and aligned:
        aligned(alignment)
    summary = RunSummary(output, log, alignment, reconstruction, frame, vertical, gravity, state)
    of_heights: list[Issue] = []
    aid = None
    if vertical == "baro":
        aid = _baro_loop(log, site, state, of_heights, strict=choices.strict)
    with SolutionWriter(
        output,
        overwrite=overwrite,
        rate_hz=rate_hz,
        pose_rate_hz=pose_rate_hz,
        location_fix=location_fix,
        copy=copy,
    ) as out:
        try:
            for nav in solve(
                log.blocks(progress),
                state,
                reconstruction=reconstruction,
                mechanization=frame,
                vertical=aid or vertical,
                gravity=gravity,
                disturbance=disturbance,
                bridge_gaps=choices.bridge_gaps,
                gaps=summary.gaps,
            ):
                out.write(nav)
                _count(summary, nav)
        except GapError as error:
            damage = "; the file is damaged: " + log.issues[0].text if log.issues else ""
            raise GapError(
                f"{error}{damage}", file=str(log.path), topic=log.topic, time_s=error.time_s
            ) from None
        except StateTimeError as error:
            what = "the alignment window leaves nothing to navigate"
            if site.initial is not None:
                what = "initial.time lies outside the log"
            raise ConfigError(f"{what}: {error}", file=site.file) from None
        issues = dict.fromkeys((*log.issues, *of_heights))
        summary.issues = [f"{issue.text} (byte {issue.offset})" for issue in issues]
        summary.notes = [note for note in log.notes if note not in known]
        end_ns = nav.epoch_ns + round(float(nav.t[-1]) * 1e9)
        out.file.add_attachment(Path(site.file).name, "application/toml", site.text, end_ns)
        out.file.add_metadata(PROVENANCE, _provenance(summary, site, aid))
    summary.seconds = time.perf_counter() - began
    return summary


def setting(name: str, choices: Choices, site: Site, allowed: Iterable[str], default: str) -> str:
    """The command line's choice, else the site file's, else the default; checked."""
    given, filed = getattr(choices, name), getattr(site, name)
    value: str = next(choice for choice in (given, filed, default) if choice is not None)
    try:
        check_choice(name, value, allowed)
    except ValueError as error:
        file = site.file if given is None else None
        raise ConfigError(str(error), file=file, key=f"mechanization.{name}") from None
    return value


def _count(summary: RunSummary, nav: Trajectory) -> None:
    summary.samples += len(nav)
    summary.final = nav.state(-1)
    summary.duration = summary.final.t - summary.first.t
    for bit in Status:
        name = bit.name or ""
        hits = int(np.count_nonzero(nav.status & np.uint32(bit)))
        summary.counts[name] = summary.counts.get(name, 0) + hits


def _disturbance(site: Site) -> DisturbanceGrid | None:
    if site.disturbance is None:
        return None
    try:
        return DisturbanceGrid.read(site.disturbance)
    except (OSError, ValueError) as error:
        key = "mechanization.disturbance"
        raise ConfigError(f"{key}: {error}", file=site.file, key=key) from None


def _baro_loop(
    log: ImuLog, site: Site, state: NavState, issues: list[Issue], *, strict: bool
) -> BaroLoop:
    """The heights of the site file's topic, on the clock of the samples, from `state` on.

    `issues` receives the defects of the file met.
    """
    baro = site.baro or BaroSettings()
    heights = read_heights(
        log.path, baro.topic, field=baro.field, quantity=baro.quantity, strict=strict
    )
    issues += heights.issues
    try:
        loop = BaroLoop(heights.seconds(log.epoch_ns), heights.h, baro.gains, baro.reference)
        return loop.aligned(state.t, state.h)
    except ValueError as error:
        raise LogError(f"the heights: {error}", file=str(log.path), topic=baro.topic) from None


def _provenance(summary: RunSummary, site: Site, aid: BaroLoop | None) -> dict[str, str]:
    log = summary.log
    alignment = summary.alignment
    return {
        "version": version("navgrade"),
        "input": Path(log.path).name,
        "input_sha256": sha256(log.path),
        "topic": log.topic,
        "schema": log.schema.name,
        "kind": log.kind,
        "axes": log.axes,
        "gyro_unit": log.gyro_unit,
        "accel_unit": log.accel_unit,
        "dv_frame": log.dv_frame,
        **({"rate_hz": str(log.rate_hz)} if log.rate_hz else {}),
        **({"accel_topic": log.accel_topic} if log.accel_topic else {}),
        **({"notes": json.dumps(log.notes)} if log.notes else {}),
        "reconstruction": summary.reconstruction,
        "frame": summary.frame,
        "vertical": summary.vertical,
        **({"loop_gains": json.dumps(aid.gains), "loop_heights": str(len(aid))} if aid else {}),
        "gravity": summary.gravity,
        **({"disturbance_sha256": sha256(site.disturbance)} if site.disturbance else {}),
        "ellipsoid": "WGS84",
        "samples": str(summary.samples),
        "alignment": json.dumps(alignment_report(alignment)) if alignment else "given state",
        **({"survey": json.dumps(site.survey)} if site.survey else {}),
        **({"survey_notes": json.dumps(site.survey_notes)} if site.survey_notes else {}),
        **({"marks_sha256": sha256(site.marks)} if site.marks else {}),
        "gaps": str(len(summary.gaps)),
        "gaps_s": json.dumps([[gap.start, gap.length] for gap in summary.gaps]),
        "defects": str(len(summary.issues)),
        "defects_text": json.dumps(summary.issues),
        **{f"samples_{name.lower()}": str(count) for name, count in summary.counts.items()},
    }
