"""Is a window still, and when is a log?

The detector is the likelihood-ratio test of specific force and rate, span by span. Under H0 the
samples of a span are a constant in white noise, and the ratio against any other motion falls into
two independent parts: the energy about the span's mean, chi-square with 6(n - 1) degrees of
freedom, and the distance of that mean from the level of the spans around, chi-square with 6.
Half of the false-alarm rate goes to each. Noise levels come from the log itself, by medians over
the surrounding minutes, which disturbances of less than 40 % of the time hardly move. Noise that
is not white spreads the energy more than its samples let expect; the excess is read off the lower
quantiles, where no disturbance is, and widens the test: fewer effective degrees of freedom.

What no IMU can tell from rest is motion at constant velocity along a straight line.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from align.spans import Spans
from earth.units import DEG

SPAN = 1.0  # s: motion is sought in means over this long, below engine vibration
FORCE_LIMIT = 0.03  # m/s^2: a parked car with people in it shows 0.009, a gentle drive 0.13
RATE_LIMIT = 0.05 * DEG  # rad/s: the same car shows 0.016 deg/s, its drive 0.3 deg/s

LARGEST = 2.0  # limits a single mean may leave its surroundings by
FLOOR = 1e-7, 1e-11  # m/s^2, rad/s: scatter below this is rounding, not noise
NOISE_SPAN = 120.0  # s on both sides tell the noise level, which an engine changes
NOISE_ROWS = 240  # at least, so that the levels' own noise adds a tenth to the false alarms
GROUP_SPAN = 4.0  # s of spans averaged before medians are taken
LEVEL_SPAN = 8.0  # s on both sides tell the level a mean is held against
NORMAL = 1.4826  # standard deviation over the median distance, of a normal distribution
PASSES = 4  # of levels from what the pass before kept
WEAK = 0.02  # share of undisturbed spans that would prolong a detection beside them
GUARD = 0.5  # s cut before and after what is detected: the onset and the dying away
BRIDGE = 2.0  # s: quiet between two detections shorter than this is no quiet
STEP = 5e-4  # m/s^2: means further apart are two attitudes, 50 µrad and as many µg
TURN = 1e-3  # rad: net rotation across a cut that makes it another attitude
STEP_SPAN = 10.0  # s on both sides of a step
SIGNIFICANT = 5.0  # standard deviations of a step that no scan over hours shows by chance
TEMPORARY = 60.0  # s: a shift that is taken back within this is a disturbance
HOLE = 15.0  # s of motion that do not end a stop, when the means agree
SWAY_SPAN = 30.0  # s: two to three periods of a ship or of a car in gusts
SWAY_LAG = 3  # s: about half a period of sway, where angles differ most
SWAY_SHARE = 0.5  # of the changes of force that tilt must leave unexplained at most
SWAY_TURN = 10.0 * DEG  # from one extreme to the other
HEAVE = 0.05  # m/s^2: scatter of |f|; a berthed ship or a parked car stays below, a drive above

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Stillness:
    """How much the one-second means of a window scatter, root sum square over the axes.

    Attributes
    ----------
    force : float
        m/s^2.
    rate : float
        rad/s.
    """

    force: float
    rate: float

    @property
    def is_still(self) -> bool:
        """True when both stay below their limits."""
        return self.force <= FORCE_LIMIT and self.rate <= RATE_LIMIT


def span_means(dt: Array, values: Array, span: float) -> Array:
    """Means of `values` (n, 3) over consecutive spans of `span` seconds, weighted by `dt`."""
    end = np.cumsum(dt)
    count = max(int(end[-1] / span + 1e-9), 1)
    group = np.minimum((end - 0.5 * dt) / span, count - 1).astype(int)
    weight = np.bincount(group, dt, minlength=count)
    sums = [np.bincount(group, dt * values[:, i], minlength=count) for i in range(3)]
    held = weight > 0.0
    means: Array = np.stack(sums, axis=-1)[held] / weight[held, None]
    return means


def assess(dt: Array, omega_ib_b: Array, f_ib_b: Array) -> Stillness:
    """Measure the scatter of one-second means of angular rate and specific force.

    Constant velocity on a straight line looks still to any IMU.
    """

    def scatter(values: Array) -> float:
        return float(np.sqrt(np.sum(np.var(span_means(dt, values, SPAN), axis=0))))

    return Stillness(force=scatter(f_ib_b), rate=scatter(omega_ib_b))


@dataclass(frozen=True, eq=False)
class Stretch:
    """A stretch of a log in which the body keeps one attitude, or sways about one.

    Attributes
    ----------
    start, stop : float
        s, on the clock of the spans.
    pieces : tuple of (float, float)
        Start and stop of what is kept, s; disturbances between them are cut out.
    rows : ndarray of bool
        The spans kept.
    duration, cut : float
        s of samples kept, and s cut out between the pieces.
    motion : {"still", "swaying"}
        Swaying is bounded rotation which the accelerometers confirm as tilt; nothing is cut.
    force_scatter, rate_scatter : float
        Scatter of one-second means, root sum square over the axes, m/s^2 and rad/s.
    arw, vrw : ndarray, shape (3,)
        Density of white noise from the scatter within spans, rad/sqrt(s) and (m/s)/sqrt(s);
        vibration is in it, sway is not.
    arw_1s, vrw_1s : ndarray, shape (3,)
        The same from the differences of consecutive one-second means (Allan deviation at 1 s):
        larger than `arw` for smoothed samples and motion, smaller for pulses and vibration.
    """

    start: float
    stop: float
    pieces: tuple[tuple[float, float], ...]
    rows: Mask
    duration: float
    cut: float
    motion: Literal["still", "swaying"]
    force_scatter: float
    rate_scatter: float
    arw: Array
    vrw: Array
    arw_1s: Array
    vrw_1s: Array


@dataclass(frozen=True, eq=False)
class StillReport:
    """The still and swaying stretches of a log.

    Attributes
    ----------
    stretches : tuple of Stretch
        In order of time.
    false_alarm : float
        Share of undisturbed spans that are taken for disturbed.
    length : float
        Of a span, s.
    alarms : ndarray of bool
        Spans in which the detector itself found motion, before guards.
    """

    stretches: tuple[Stretch, ...]
    false_alarm: float
    length: float
    alarms: Mask

    @property
    def longest(self) -> Stretch | None:
        """The stretch with most time kept."""
        return max(self.stretches, key=lambda stretch: stretch.duration, default=None)


def find_still(spans: Spans, *, false_alarm: float = 1e-3, least: float = 10.0) -> StillReport:
    """Find the stretches of a log in which the body stands still or sways.

    Parameters
    ----------
    spans : Spans
        Of about `align.spans.natural_length`.
    false_alarm : float
        Share of undisturbed spans the detector may take for disturbed, before guards: honored
        within a fifth in Gaussian white noise, and within six times 1e-3 in smoothed or quantized
        noise, whose tails the lower quantiles cannot tell.
    least : float
        Shortest stretch worth reporting, s kept.

    Raises
    ------
    ValueError
        When `false_alarm` is not between 0 and 0.5.

    Notes
    -----
    A lasting step of attitude ends a stretch and begins another; a shift taken back within a
    minute is cut out. A swaying body is reported whole. Smooth motion at constant velocity is
    called still.
    """
    if not 0.0 < false_alarm < 0.5:
        raise ValueError(f"false_alarm must be between 0 and 0.5, got {false_alarm}")
    alarms, sways = np.zeros(len(spans), bool), _sways(spans)
    found: list[Stretch | None] = []
    for first, stop, standing in _stops(spans, least):
        inside = slice(first, stop)
        if np.mean(sways[inside]) > 0.5:
            sways[inside] = True
            continue
        sways[inside] = False
        alarms[inside], quiet = _detect(spans[inside], standing, false_alarm)
        for rows in _attitudes(spans[inside], np.flatnonzero(quiet)):
            found.append(_stretch(spans, first + rows, "still", least))
    for first, stop in _runs(sways):
        found.append(_stretch(spans, np.arange(first, stop), "swaying", least))
    stretches = sorted((x for x in found if x is not None), key=lambda stretch: stretch.start)
    return StillReport(tuple(stretches), false_alarm, spans.length, alarms)


def _medians(values: Array, size: int, mode: Literal["edge", "symmetric"]) -> Array:
    """Medians of `size` rows, an odd number, around each row; `mode` of `numpy.pad`.

    SciPy 1.17, left to go over the ends itself, reads foreign memory where there are fewer rows.
    """
    half = size // 2
    padded = np.pad(values, ((half, half), (0, 0)), mode)
    medians: Array = scipy.ndimage.median_filter(padded, (size, 1))[half : half + len(values)]
    return medians


def _rows(spans: Spans, seconds: float) -> int:
    return max(round(seconds / spans.length), 1)


def _runs(mask: Mask) -> list[tuple[int, int]]:
    """First row and the row after the last of each run of True."""
    edges = np.flatnonzero(np.diff(mask, prepend=False, append=False))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def _seconds(spans: Spans) -> tuple[Integers, Integers]:
    """Number of the second (or longer span) each row belongs to, and the same without holes."""
    place = np.rint((spans.end - spans.end[:1]) / spans.length).astype(np.int64)
    second = place // _rows(spans, SPAN)
    return second, np.unique(second, return_inverse=True)[1]


def _means(weight: Array, values: Array, group: Integers) -> Array:
    total = np.bincount(group, weight)
    columns = [np.bincount(group, weight * values[:, i]) for i in range(values.shape[1])]
    means: Array = np.stack(columns, axis=-1) / total[:, None]
    return means


def _stops(spans: Spans, least: float) -> list[tuple[int, int, Mask]]:
    """Runs of rows in which one-second means stay within the limits, short holes included.

    For each: first row, the row after the last, and which of its rows are within the limits.
    """
    if not len(spans):
        return []
    whole = spans.count >= max(2.0, 0.5 * float(np.median(spans.count)))
    scaled = np.hstack([spans.omega_ib_b / RATE_LIMIT, spans.f_ib_b / FORCE_LIMIT])
    mean = scipy.ndimage.uniform_filter1d(scaled, _rows(spans, SPAN), axis=0, mode="nearest")
    level = _medians(mean, 2 * _rows(spans, LEVEL_SPAN) + 1, "edge")
    off = np.sum((mean - level).reshape(-1, 2, 3) ** 2, axis=-1)
    standing = whole & np.all(off <= LARGEST**2, axis=-1)
    groups: list[list[tuple[int, int]]] = []
    recent: list[list[tuple[int, int]]] = []
    for run in _runs(standing):
        if run[1] - run[0] < _rows(spans, BRIDGE):
            continue
        here = scaled[slice(*run)].mean(0)
        recent = [x for x in recent if spans.start[run[0]] - spans.end[x[-1][1] - 1] <= HOLE]
        for group in reversed(recent):
            apart = (here - scaled[slice(*group[-1])].mean(0)).reshape(2, 3)
            if np.all(np.sum(apart**2, axis=-1) <= 1.0):
                group.append(run)
                break
        else:
            groups.append([run])
            recent.append(groups[-1])
    stops: list[tuple[int, int, Mask]] = []
    for group in sorted(groups, key=lambda group: group[0][0] - group[-1][1]):
        first, stop = group[0][0], group[-1][1]
        lasts = spans.length * sum(b - a for a, b in group)
        if lasts >= least and not any(first < b and a < stop for a, b, _ in stops):
            stops.append((first, stop, standing[first:stop]))
    return sorted(stops, key=lambda stop: stop[0])


def _local(values: Array, keep: Mask, half: int) -> Array:
    """Medians of the kept rows, `half` of them on either side of each row."""
    kept = np.flatnonzero(keep)
    size = min(2 * half + 1, 2 * len(kept) - 1)
    medians = _medians(values[kept], size, "symmetric")
    at = np.arange(len(values))
    return np.stack([np.interp(at, kept, column) for column in medians.T], axis=-1)


def _local_power(squares: Array, keep: Mask, half: int, size: int, dof: float) -> Array:
    """Local means of chi-square variables of `dof`, as medians of the means of `size` kept rows.

    The median of single rows would be 0 where few pulses come, as of quantized increments.
    """
    kept = np.flatnonzero(keep)
    size = min(size, len(kept))
    groups = kept[: len(kept) - len(kept) % size].reshape(-1, size)
    means = squares[groups].mean(1) / (1.0 - 2.0 / (9.0 * size * dof)) ** 3
    spread = _medians(means, 2 * (half // size) + 1, "symmetric")
    at, centers = np.arange(len(squares)), groups.mean(1)
    return np.stack([np.interp(at, centers, column) for column in spread.T], axis=-1)


def _normal(ratio: Array, dof: Array | float) -> Array:
    """Wilson and Hilferty: chi-square over its degrees of freedom as a standard normal."""
    width = 2.0 / (9.0 * dof)
    normal: Array = (np.cbrt(ratio) - (1.0 - width)) / np.sqrt(width)
    return normal


def _standardize(z: Array, keep: Mask) -> Array:
    """Center on the median; divide by the spread below it where noise is less than white."""
    low, middle = np.quantile(z[keep], [scipy.special.ndtr(-1.0), 0.5])
    standard: Array = (z - middle) / max(middle - low, 1.0)
    return standard


def _detect(spans: Spans, standing: Mask, false_alarm: float) -> tuple[Mask, Mask]:
    """Rows in which motion is found, and rows that are left as quiet with guards drawn."""
    variance = np.hstack([spans.omega_var, spans.f_var])
    mean = np.hstack([spans.omega_ib_b, spans.f_ib_b])
    floor = np.repeat(FLOOR, 3)
    dof = np.maximum(spans.count - 1, 1)[:, None]
    weight = np.sqrt(spans.dt / spans.length)[:, None]
    group = _rows(spans, GROUP_SPAN)
    noise_rows = max(_rows(spans, NOISE_SPAN), NOISE_ROWS)
    level_rows = _rows(spans, LEVEL_SPAN)
    limit, weak = -scipy.special.ndtri(0.5 * false_alarm), -scipy.special.ndtri(WEAK)
    usual = float(np.median(dof))
    bridge, guard = _rows(spans, BRIDGE), int(np.ceil(GUARD / spans.length - 1e-6))
    quiet = standing
    for _ in range(PASSES):
        sigma2 = np.maximum(_local_power(variance, quiet, noise_rows, group, usual), floor**2)
        energy = _normal(np.mean(variance / sigma2, axis=1), variance.shape[1] * dof[:, 0])
        off2 = weight**2 * (mean - _local(mean, quiet, level_rows)) ** 2
        spread2 = np.maximum(_local_power(off2, quiet, noise_rows, group, 1.0), floor**2)
        distance = _normal(np.mean(off2 / spread2, axis=1), 6.0)
        z = np.maximum(_standardize(energy, quiet), _standardize(distance, quiet))
        alarms = z > limit
        moved = ~standing | scipy.ndimage.binary_propagation(alarms, mask=alarms | (z > weak))
        padded = np.pad(moved, bridge)
        closed = scipy.ndimage.binary_closing(padded, np.ones(bridge + 1))[bridge:-bridge] | moved
        quiet_now = ~scipy.ndimage.binary_dilation(closed, np.ones(2 * guard + 1))
        if not quiet_now.any():
            return alarms, quiet_now
        if np.array_equal(quiet_now, quiet):
            break
        quiet = quiet_now
    return alarms, quiet


def _attitudes(spans: Spans, kept: Integers) -> list[Integers]:
    """Quiet rows grouped by attitude: split at steps, joined where a shift was taken back."""
    if len(kept) < 2:
        return []
    f, total = spans.f_ib_b[kept], len(kept)
    w = max(min(_rows(spans, STEP_SPAN), total // 4), 1)
    sums = np.cumsum(np.vstack([np.zeros(3), f]), axis=0)
    means = (sums[w:] - sums[:-w]) / w
    change = means[w:] - means[:-w]
    sigma = NORMAL * np.linalg.norm(np.median(np.abs(change), axis=0))
    limit = max(STEP, SIGNIFICANT * sigma)
    size = np.linalg.norm(change, axis=1)
    holes = np.flatnonzero(np.diff(kept) > 1).tolist()
    cuts: set[int] = {k + 1 for k in holes if _turns(spans, kept, k, k + 1)}
    while size.size and size.max() > limit:
        k = int(np.argmax(size))
        cuts.add(k + w)
        size[max(k - w, 0) : k + w + 1] = 0.0
    edges = [0, *sorted(cuts), total]

    def agree(a: tuple[int, int], b: tuple[int, int]) -> bool:
        apart = np.linalg.norm(f[slice(*a)].mean(0) - f[slice(*b)].mean(0))
        short = min(a[1] - a[0], b[1] - b[0])
        near = apart <= limit * max(1.0, np.sqrt(w / short))
        return bool(near) and not _turns(spans, kept, a[1] - 1, b[0])

    groups: list[list[tuple[int, int]]] = []
    for part in pairwise(edges):
        brief = len(groups) > 1 and sum(b - a for a, b in groups[-1]) <= _rows(spans, TEMPORARY)
        if groups and agree(groups[-1][-1], part):
            groups[-1].append(part)
        elif brief and agree(groups[-2][-1], part):
            groups.pop()
            groups[-1].append(part)
        else:
            groups.append([part])
    return [np.concatenate([kept[slice(*part)] for part in group]) for group in groups]


def _turns(spans: Spans, kept: Integers, a: int, b: int) -> bool:
    """Whether the body has turned between two kept rows, by the integral of the rate."""
    reach = _rows(spans, LEVEL_SPAN)
    between = slice(kept[a] + 1, kept[b])
    near = np.r_[kept[max(a + 1 - reach, 0) : a + 1], kept[b : b + reach]]
    rate = spans.omega_ib_b[near]
    dt = spans.dt[between]
    turn = np.linalg.norm(dt @ (spans.omega_ib_b[between] - rate.mean(0)))
    lasts = dt.sum()
    noise = np.linalg.norm(rate.std(0)) * np.sqrt(spans.length * lasts + lasts**2 / len(near))
    return bool(turn > max(TURN, SIGNIFICANT * noise))


def _sways(spans: Spans) -> Mask:
    """Rows in which the body sways: force changes as the integral of the rate tilts it.

    Held against each other are changes over `SWAY_LAG` seconds, by their medians over
    `SWAY_SPAN`: steps and slams are too few to count. A second sways when most of the windows
    over it do.
    """
    none = np.zeros(len(spans), bool)
    group = _seconds(spans)[1]
    if not len(spans) or group[-1] < 9:
        return none
    step = spans.omega_ib_b * spans.dt[:, None]
    angle = _means(spans.dt, np.cumsum(step, axis=0) - 0.5 * step, group)
    f = _means(spans.dt, spans.f_ib_b, group)
    lag = max(round(SWAY_LAG / (_rows(spans, SPAN) * spans.length)), 1)
    up = 0.5 * (f[lag:] + f[:-lag])
    change = f[lag:] - f[:-lag]
    change -= up * (np.sum(change * up, axis=1) / np.sum(up * up, axis=1))[:, None]
    tilt = np.cross(up, angle[lag:] - angle[:-lag])
    n = min(round(SWAY_SPAN / (_rows(spans, SPAN) * spans.length)), len(f)) - lag
    if n < 2:
        return none
    windows = sliding_window_view(np.stack([change, change - tilt]), n, axis=1)
    windows = windows - np.median(windows, axis=-1, keepdims=True)
    size, rest = np.median(np.linalg.norm(windows, axis=2), axis=-1)
    extent = np.ptp(sliding_window_view(angle, n + lag, axis=0), axis=-1).max(-1)
    heave = sliding_window_view(np.linalg.norm(f, axis=1), n + lag).std(-1)
    good = (rest < SWAY_SHARE * size) & (extent < SWAY_TURN) & (heave < HEAVE)
    over = np.convolve(good, np.ones(n + lag))
    all_ = np.convolve(np.ones(len(good)), np.ones(n + lag))
    sways = over > 0.5 * all_
    inner: Mask = scipy.ndimage.binary_erosion(sways, np.ones(2 * lag + 1), border_value=1)[group]
    return inner


def _white(part: Spans, means: Array, follow: Mask) -> Array:
    """Densities of white noise, (6,), from the scatter within spans.

    What a smooth motion scatters within a span, the cubic that has the means of the five spans
    around tells. It is taken off, and the quarter of the spans where it is least is used.
    """
    variance = np.hstack([part.omega_var, part.f_var])
    dt = np.repeat((part.dt / part.count)[:, None], 6, axis=1)
    smooth = np.zeros_like(variance)
    if len(follow) > 3 and (inner := np.flatnonzero(sliding_window_view(follow, 4).all(-1))).size:
        a, b, c, d, e = (means[inner + i] for i in range(5))
        slope = 41.0 / 60.0 * (d - b) - 11.0 / 120.0 * (e - a)  # of the best line, over a span
        smooth = slope**2 / 12.0 + (b - 2.0 * c + d) ** 2 / 720.0
        smooth *= 1.0 + 1.0 / part.count[inner + 2, None]
        least = np.argsort(smooth, axis=0)[: -(-len(inner) // 4)]
        columns = variance[inner + 2], dt[inner + 2], smooth
        variance, dt, smooth = (np.take_along_axis(x, least, axis=0) for x in columns)
    motion = np.mean(smooth * dt, axis=0)  # known to a thousandth: the least that can be left
    rest = np.maximum(np.mean(variance * dt, axis=0) - motion, 1e-3 * motion)
    density: Array = np.sqrt(rest)
    return density


def _stretch(
    spans: Spans, rows: Integers, motion: Literal["still", "swaying"], least: float
) -> Stretch | None:
    """Describe the rows; None when they are too short, or move too much to be still."""
    part = spans[rows]
    if not len(rows) or part.dt.sum() < least:
        return None
    second, group = _seconds(part)
    values = np.hstack([part.omega_ib_b, part.f_ib_b])
    means = _means(part.dt, values, group)
    scatter = [float(np.sqrt(np.sum(np.var(means[:, i : i + 3], axis=0)))) for i in (0, 3)]
    if motion == "still" and not Stillness(force=scatter[1], rate=scatter[0]).is_still:
        return None
    between: Mask = np.rint(np.diff(part.end) / part.length) == 1
    white = _white(part, values, between)
    follow = np.diff(np.unique(second)) == 1
    differences = np.diff(means, axis=0)[follow]
    length = _rows(spans, SPAN) * spans.length
    allan = np.sqrt(0.5 * length * np.mean(differences**2, axis=0)) if follow.any() else white
    edges = np.flatnonzero(~between)
    starts, stops = part.start[np.r_[0, edges + 1]], part.end[np.r_[edges, -1]]
    mask = np.zeros(len(spans), bool)
    mask[rows] = True
    duration = float(part.dt.sum())
    return Stretch(
        start=float(starts[0]),
        stop=float(stops[-1]),
        pieces=tuple(zip(starts.tolist(), stops.tolist(), strict=True)),
        rows=mask,
        duration=duration,
        cut=float(np.sum(starts[1:] - stops[:-1])),
        motion=motion,
        force_scatter=scatter[1],
        rate_scatter=scatter[0],
        arw=white[:3],
        vrw=white[3:],
        arw_1s=allan[:3],
        vrw_1s=allan[3:],
    )
