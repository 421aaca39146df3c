"""From a scenario to a log, block by block."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from earth.ellipsoid import WGS84
from earth.geodetic import curvatures
from earth.units import DEG_PER_S, STANDARD_GRAVITY
from navgrade.errors import ConfigError
from navgrade.imu import ImuSamples
from navgrade.logs.recording import RecordingWriter
from navgrade.logs.thinning import Thinning
from navgrade.sensors import ImuErrors, Sensor
from navgrade.simulate.imu import Extremes, extremes, imu_increments, imu_rates, true_trajectory
from navgrade.simulate.motion import Mounted
from navgrade.simulate.scenario import Scenario
from navgrade.state import Columns, NavState, Trajectory

Array = NDArray[np.float64]
Nanoseconds = NDArray[np.int64]

SIMULATION = "navgrade.simulation"
# What common IMUs hold: MEMS gyros end at 2000 deg/s, ring lasers at about 1000; navigation
# accelerometers at 20 to 40 g, those of tactical IMUs at 50 g.
RATE_RANGE = 2000.0 * DEG_PER_S  # rad/s
FORCE_RANGE = 50.0 * STANDARD_GRAVITY  # m/s^2

_BLOCK = 16_384  # samples made at a time
_JITTER, _LOSS, _FIXES = range(3)  # keys of their random sequences


@dataclass(frozen=True)
class Simulated:
    """What was written.

    Attributes
    ----------
    output : Path
    topic, axes : str
        Of the IMU in the log.
    samples, lost, truth, fixes : int
        Messages of the IMU written and left out, of the truth, of the receiver.
    first_ns : int
        Stamp of the first sample, ns since 1970.
    duration : float
        From the start of the first sample's interval to the last stamp, s.
    distance : float
        Over ground, between the rows of the truth, m.
    extremes : Extremes
        The largest rate, force and speed of the IMU.
    errors : ImuErrors
        The constants that were drawn, and the processes.
    first, last : NavState
        The truth at the first and at the last sample written.
    warnings : tuple of str
    """

    output: Path
    topic: str
    axes: str
    samples: int
    lost: int
    truth: int
    fixes: int
    first_ns: int
    duration: float
    distance: float
    extremes: Extremes
    errors: ImuErrors
    first: NavState
    last: NavState
    warnings: tuple[str, ...]


def simulate(
    scenario: Scenario,
    output: str | Path,
    *,
    overwrite: bool = False,
    progress: Callable[[int], None] | None = None,
) -> Simulated:
    """Write the log of a scenario; memory does not grow with it.

    The IMU's samples are exact integrals, or values, of the rate and force of its own point and
    axes, to which its errors are added. Stamps are whole nanoseconds and tell the true ends of the
    intervals, jitter included. A lost message takes its increment with it. Truth is that of the
    IMU's point and axes at the stamps nearest to its ticks, lost samples included; fixes are of the
    antenna.

    Parameters
    ----------
    scenario : Scenario
    output : path
        Ends in .mcap; appears when it is complete.
    overwrite : bool
    progress : callable, optional
        Called with the number of samples made so far.

    Raises
    ------
    ConfigError
        When `output` must not be written, or all messages would be lost.
    """
    output = Path(output)
    if output.suffix != ".mcap":
        raise ConfigError(f"the output {output} does not end in .mcap")
    imu = scenario.imu
    run = _Run(scenario)
    try:
        out = RecordingWriter(output, imu.kind, axes=imu.axes, topic=imu.topic, overwrite=overwrite)
    except ValueError as error:
        raise ConfigError(f"imu.topic: {error}", file=scenario.file, key="imu.topic") from None
    with out:
        out.file.add_metadata(SIMULATION, _origin(scenario, run.sensor.errors))
        for samples, truth, fixes in run.blocks():
            out.write(samples, truth, fixes, run.fix_sigma)
            if progress:
                progress(run.made)
        if not run.samples:
            raise ConfigError("every message of the IMU would be lost", file=scenario.file)
        name = Path(scenario.file).name
        out.file.add_attachment(name, "application/toml", scenario.text, scenario.start_ns)
    assert run.first is not None
    found = extremes(scenario.imu_motion)
    return Simulated(
        output=output,
        topic=out.imu.name,
        axes=out.imu.axes,
        samples=run.samples,
        lost=run.made - run.samples,
        truth=run.truth,
        fixes=run.fixes,
        first_ns=run.first_ns,
        duration=run.duration,
        distance=run.distance,
        extremes=found,
        errors=run.sensor.errors,
        first=run.first,
        last=run.last,
        warnings=(*scenario.notes, *_beyond_range(found)),
    )


class _Run:
    """The state carried from block to block, and the counts."""

    def __init__(self, scenario: Scenario) -> None:
        imu, motion = scenario.imu, scenario.imu_motion
        self.sensor = Sensor(imu.errors, imu.seed)
        self.samples = self.made = self.truth = self.fixes = 0
        self.first_ns = 0
        self.distance = self.duration = 0.0
        self.first: NavState | None = None
        self.last: NavState
        self.fix_sigma = (0.0, 0.0, 0.0)
        self._scenario, self._motion = scenario, motion
        self._end_ns = int(np.floor((motion.end - motion.start) * 1e9 + 0.5))
        self._total = int(np.floor(self._end_ns * 1e-9 * imu.rate_hz + 1e-6))
        self._sequences = [
            np.random.default_rng(np.random.SeedSequence(imu.seed, spawn_key=(2, key)))
            for key in (_JITTER, _LOSS, _FIXES)
        ]
        self._thinning = Thinning(scenario.truth_rate_hz)
        self._before: tuple[float, float] | None = None
        if scenario.gnss is not None:
            horizontal = scenario.gnss.horizontal_sigma
            self.fix_sigma = (horizontal, horizontal, scenario.gnss.vertical_sigma)

    def blocks(self) -> Iterator[tuple[ImuSamples, Trajectory, Trajectory]]:
        """Yield samples as recorded, truth and fixes."""
        edge_ns = np.zeros(1, np.int64)
        while self.made < self._total:
            count = min(_BLOCK, self._total - self.made)
            edges_ns = np.concatenate([edge_ns, self._edges_ns(count)])
            samples = self._samples(edges_ns)
            truth = self._truth(samples)
            fixes = self._fixes(int(edges_ns[0]), int(edges_ns[-1]))
            self.made += count
            recorded = self._recorded(samples, self._kept(samples))
            edge_ns = edges_ns[-1:]
            self.duration = float(edge_ns[0]) * 1e-9
            self.truth += len(truth)
            self.fixes += len(fixes)
            yield recorded, truth, fixes

    def _edges_ns(self, count: int) -> Nanoseconds:
        """The next ends of intervals, ns after the start."""
        imu = self._scenario.imu
        ticks = np.arange(self.made + 1, self.made + count + 1)
        edges = ticks * (1e9 / imu.rate_hz)
        if imu.jitter:
            noise = imu.jitter * 1e9 * self._sequences[_JITTER].standard_normal(count)
            limit = 0.4e9 / imu.rate_hz  # two neighbours stay in order
            edges = edges + np.clip(noise, -limit, limit)
        return np.asarray(np.minimum(np.rint(edges), self._end_ns), np.int64)

    def _samples(self, edges_ns: Nanoseconds) -> ImuSamples:
        """True samples, with the errors of the sensor."""
        kind = self._scenario.imu.kind
        edges = self._clock(_seconds(edges_ns))
        t, dt = _seconds(edges_ns[1:]), _seconds(np.diff(edges_ns))
        if kind == "rate":
            gyro, accel = imu_rates(self._motion, edges[1:])
        else:
            gyro, accel = imu_increments(self._motion, edges)
            if kind == "average":
                gyro, accel = gyro / dt[:, None], accel / dt[:, None]
        true = ImuSamples(
            t=t,
            dt=dt,
            gyro=gyro,
            accel=accel,
            kind=kind,
            epoch_ns=self._scenario.start_ns,
        )
        return self.sensor.measure(true)

    def _clock(self, t: Array) -> Array:
        """The motion's own time, s, at instants after its start."""
        start, end = self._motion.start, self._motion.end
        return np.asarray(np.minimum(start + t, end))

    def _true(self, t: Array) -> Trajectory:
        found = true_trajectory(self._motion, self._clock(t), self._scenario.start_ns)
        return replace(found, t=t)

    def _truth(self, samples: ImuSamples) -> Trajectory:
        """Truth at the samples nearest to its ticks, and the way between them."""
        rows = self._thinning.rows(samples.t)
        if not len(rows):
            return _NOTHING
        truth = self._true(samples.t[rows])
        t, speed = truth.t, np.hypot(truth.v_eb_n[:, 0], truth.v_eb_n[:, 1])
        if self._before is not None:
            t = np.append(self._before[0], t)
            speed = np.append(self._before[1], speed)
        self.distance += float(np.sum(0.5 * (speed[1:] + speed[:-1]) * np.diff(t)))
        self._before = float(t[-1]), float(speed[-1])
        return truth

    def _kept(self, samples: ImuSamples) -> NDArray[np.bool_]:
        """Which messages arrive."""
        imu = self._scenario.imu
        kept = np.ones(len(samples), bool)
        if imu.dropped:
            kept &= self._sequences[_LOSS].random(len(samples)) >= imu.dropped
        for begin, end in imu.dropped_spans:
            kept &= (samples.t <= begin) | (samples.t > end)
        return kept

    def _recorded(self, samples: ImuSamples, kept: NDArray[np.bool_]) -> ImuSamples:
        if not kept.all():
            samples = ImuSamples(
                t=samples.t[kept],
                dt=samples.dt[kept],
                gyro=samples.gyro[kept],
                accel=samples.accel[kept],
                kind=samples.kind,
                epoch_ns=samples.epoch_ns,
            )
        if len(samples):
            if self.first is None:
                self.first = self._true(samples.t[:1]).state(0)
                self.first_ns = samples.epoch_ns + round(float(samples.t[0]) * 1e9)
            self.last = self._true(samples.t[-1:]).state(0)
            self.samples += len(samples)
        return samples

    def _fixes(self, after_ns: int, until_ns: int) -> Trajectory:
        """Fixes from an instant on and before another, ns after the start."""
        scenario, gnss = self._scenario, self._scenario.gnss
        if gnss is None:
            return _NOTHING
        period = 1e9 / gnss.rate_hz
        last = until_ns + 1 if until_ns >= self._end_ns else until_ns
        ticks = np.arange(np.ceil(after_ns / period), np.ceil(last / period))
        at_ns = np.rint(ticks * period).astype(np.int64)
        t = _seconds(at_ns[(at_ns >= after_ns) & (at_ns < last)])
        if not len(t):
            return _NOTHING
        antenna = Mounted(scenario.motion, gnss.lever_arm_b)
        true = true_trajectory(antenna, self._clock(t), scenario.start_ns)
        north, east, down = (
            self._sequences[_FIXES].standard_normal((len(t), 3)) * self.fix_sigma
        ).T
        per_meridian, per_transverse = curvatures(WGS84.params, np.sin(true.lat), true.h)
        return replace(
            true,
            t=t,
            lat=true.lat + north * per_meridian,
            lon=true.lon + east * per_transverse / np.cos(true.lat),
            h=true.h - down,
        )


_NOTHING = Trajectory.made(np.empty(0), Columns.empty(0), np.empty(0, np.uint32), 0)


def _seconds(ns: Nanoseconds) -> Array:
    return np.asarray(ns * 1e-9, np.float64)


def _origin(scenario: Scenario, errors: ImuErrors) -> dict[str, str]:
    imu = scenario.imu
    return {
        "version": version("navgrade"),
        "scenario": Path(scenario.file).name,
        "seed": str(imu.seed),
        "grade": imu.grade or "none",
        "ellipsoid": "WGS84",
        "errors": json.dumps(errors_report(errors)),
    }


def errors_report(errors: ImuErrors) -> dict[str, dict[str, object]]:
    """Errors of a run as plain types, SI."""
    return {
        part: {
            name: value.tolist() if isinstance(value, np.ndarray) else value
            for name, value in vars(getattr(errors, part)).items()
            if np.any(value) and np.all(np.isfinite(value))
        }
        for part in ("gyro", "accel")
    }


def _beyond_range(found: Extremes) -> list[str]:
    warnings = []
    if found.omega > RATE_RANGE:
        warnings.append(
            f"the angular rate reaches {found.omega / DEG_PER_S:.0f} °/s at {found.omega_t:.1f} s; "
            f"IMUs measure up to about {RATE_RANGE / DEG_PER_S:.0f} °/s"
        )
    if found.f > FORCE_RANGE:
        warnings.append(
            f"the specific force reaches {found.f / STANDARD_GRAVITY:.1f} g at {found.f_t:.1f} s; "
            f"IMUs measure up to about {FORCE_RANGE / STANDARD_GRAVITY:.0f} g"
        )
    return warnings
