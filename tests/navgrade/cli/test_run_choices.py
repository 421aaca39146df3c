"""``navgrade run`` with every choice it offers: what it does, what it records, what it refuses."""

from __future__ import annotations

import hashlib
import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_typestore

import navgrade
from navgrade.logs import read_heights
from navgrade.mechanization import FLAT_WORLD, MECHANIZATIONS
from navgrade.reconstruction import RECONSTRUCTIONS
from navgrade.vertical import BaroLoop, gains_from_time_constant
from tests.navgrade.cli.calling import Bench
from tests.navgrade.logmaking import (
    EPOCH_NS,
    SITE,
    Channel,
    Recording,
    imu_channel,
    resting,
    started_site,
)
from tests.navgrade.logs.decoding import solution
from tests.oracles.truth import ecef

Array = NDArray[np.float64]

RATE = 50.0  # Hz
DEG = math.pi / 180.0  # rad
ARCSEC = DEG / 3600.0  # rad
ROS = get_typestore(Stores.ROS2_HUMBLE)
BRIDGED, SHORT, SHIFTED, UNAIDED = 1, 4, 8, 16  # bits of status, docs/conventions.md


def drive(seconds: float = 20.0) -> Recording:
    """At rest for the alignment window, then moving."""
    return resting(seconds, RATE, sway_from_s=10.5)


def site(table: str = "", *, height: float = 0.0, baro: str | None = None) -> str:
    """The site file with what stands under [mechanization] and [baro]."""
    text = SITE.replace("height_m = 0.0", f"height_m = {height}")
    if table:
        text += f"[mechanization]\n{table}\n"
    return text if baro is None else f"{text}[baro]\n{baro}\n"


def columns(bench: Bench) -> dict[str, bytes]:
    """All members of the solution, to the last bit."""
    return {name: values.tobytes() for name, values in solution(bench.out).items()}


def positions(bench: Bench) -> Array:
    """Earth-fixed positions of the solution, m."""
    found = solution(bench.out)
    return ecef(found["latitude_deg"] * DEG, found["longitude_deg"] * DEG, found["height_m"])


def last_ned(bench: Bench, other: Array) -> Array:
    """How far the last position is from another one, north, east, down at 45 N, 8 E, m."""
    (lat, lon) = (45.0 * DEG, 8.0 * DEG)
    dx, dy, dz = positions(bench)[-1] - other
    outward = math.cos(lon) * dx + math.sin(lon) * dy
    return np.array(
        [
            math.cos(lat) * dz - math.sin(lat) * outward,
            math.cos(lon) * dy - math.sin(lon) * dx,
            -math.cos(lat) * outward - math.sin(lat) * dz,
        ]
    )


# ---- reconstruction ----------------------------------------------------------------------------


def test_without_a_word_it_looks_around(bench: Bench) -> None:
    bench.write(imu_channel(drive()), site=site())
    out = bench.accepted().out
    found = bench.provenance()
    chosen = [found[key] for key in ("reconstruction", "frame", "vertical", "gravity")]
    assert chosen == ["centred-9", "n", "free", "closed-form"]
    assert "Navigation  centred-9, frame n, vertical free" in out
    # nine samples around each: the window moves aside for the last four
    _, status = bench.stamps_and_status()
    assert np.flatnonzero(status).tolist() == list(range(496, 500))
    assert set(status[-4:].tolist()) == {SHIFTED}
    assert found["samples_shifted_window"] == "4"


def test_causal_uses_no_later_sample(bench: Bench) -> None:
    bench.write(imu_channel(drive()), site=site('reconstruction = "centred-5"'))
    bench.accepted("--causal")
    assert bench.provenance()["reconstruction"] == "causal-3"
    causal = columns(bench)
    bench.accepted("--overwrite", "--reconstruction", "causal-3")
    assert columns(bench) == causal
    bench.accepted("--overwrite", "--causal", "--reconstruction", "causal-3")
    assert columns(bench) == causal
    # what comes later changes nothing
    bench.write(imu_channel(drive(15.0)))
    bench.accepted("--overwrite", "--causal")
    shorter = columns(bench)
    assert len(shorter["status"]) * 2 == len(causal["status"])
    for name, values in shorter.items():
        assert causal[name].startswith(values), name


@pytest.mark.parametrize("other", ["centred-9", "causal-4", "nonsense"])
def test_causal_and_another_reconstruction_contradict(bench: Bench, other: str) -> None:
    bench.write(imu_channel(drive()), site=site())
    outcome = bench.run("--causal", "--reconstruction", other)
    assert outcome.code == 2
    assert outcome.err.startswith("Usage: navgrade run")
    assert (
        f"--causal means --reconstruction causal-3; give it or '{other}', not both" in outcome.err
    )
    bench.left_nothing()


@pytest.mark.parametrize("samples", [2, 3, 4])
def test_a_block_form_writes_one_row_for_its_samples(bench: Bench, samples: int) -> None:
    recording = drive()  # 501 samples to 10 s, and 500 more
    bench.write(imu_channel(recording), site=site())
    out = bench.accepted("--reconstruction", f"samples-{samples}").out
    stamp_ns, status = bench.stamps_and_status()
    rows = -(-500 // samples)
    assert len(stamp_ns) == rows
    after = recording.stamp_ns[501:]
    ends = np.append(after[samples - 1 :: samples], after[-1])[:rows]
    assert stamp_ns.tolist() == ends.tolist()
    left = 500 % samples  # in the last row
    assert np.flatnonzero(status).tolist() == ([rows - 1] if left else [])
    assert ("short windows         1" in out) == bool(left)
    assert "10.000 s" in out


def test_every_reconstruction_can_be_named_in_the_site_file(bench: Bench) -> None:
    ends = {}
    for name in RECONSTRUCTIONS:
        bench.write(imu_channel(drive(16.0)), site=site(f'reconstruction = "{name}"'))
        bench.accepted("--overwrite")
        assert bench.provenance()["reconstruction"] == name
        ends[name] = positions(bench)[-1]
    reference = ends.pop("centred-9")
    apart = {name: float(np.abs(end - reference).max()) for name, end in ends.items()}
    without = apart.pop("none"), apart.pop("euler")  # the force is not turned within an interval
    # m: rates of 2 deg/s at 0.5 Hz leave less than 1 mm in 6 s at 50 Hz, if they are compensated
    assert max(apart.values()) < 1e-3
    assert min(without) > 2.0 * max(apart.values())


# ---- frames ------------------------------------------------------------------------------------


def test_every_frame_writes_the_same_solution(bench: Bench) -> None:
    bench.write(imu_channel(drive()), site=site())
    bench.accepted()
    wanted, stamps = positions(bench), bench.stamps_and_status()
    for frame in MECHANIZATIONS:
        out = bench.accepted("--overwrite", "--frame", frame).out
        assert f"frame {frame}," in out
        assert bench.provenance()["frame"] == frame
        # m: 10 s at 50 Hz; degrees are written with 1e-9 m
        assert np.abs(positions(bench) - wanted).max() < 1e-7
        for mine, theirs in zip(bench.stamps_and_status(), stamps, strict=True):
            assert mine.tolist() == theirs.tolist()


def test_frames_e_i_and_w_run_where_n_ends(bench: Bench) -> None:
    bench.write(imu_channel(drive()), site=started_site(latitude=89.95))
    bench.refused("frame n ends at latitude ±89.9°", "w (wander azimuth)")
    for frame in ("e", "i", "w"):
        bench.accepted("--frame", frame, "--overwrite")


# ---- a flat world ------------------------------------------------------------------------------


@pytest.mark.parametrize("frame", FLAT_WORLD)
def test_a_flat_world_is_a_frame_with_its_own_body_stage(bench: Bench, frame: str) -> None:
    bench.write(imu_channel(drive()), site=site())
    bench.accepted()
    wanted = positions(bench)
    out = bench.accepted("--overwrite", "--frame", frame).out
    own = FLAT_WORLD[frame].reconstruction or "centred-9"
    assert f"Navigation  {own}, frame {frame}, vertical free" in out
    found = bench.provenance()
    assert (found["frame"], found["reconstruction"]) == (frame, own)
    # m after 10 s: g omega cos(45) t^3 / 6, 84 mm
    away = float(np.linalg.norm(positions(bench)[-1] - wanted[-1]))
    assert away == pytest.approx(0.084, rel=0.2 if own == "euler" else 0.02)


def test_a_flat_world_in_the_site_file(bench: Bench) -> None:
    bench.write(imu_channel(drive()), site=site('frame = "flat-midpoint"'))
    bench.accepted()
    assert bench.provenance()["reconstruction"] == "midpoint"


@pytest.mark.parametrize(
    ("table", "options", "fact"),
    [
        ("", ("--reconstruction", "centred-9"), "'flat-euler' brings its own reconstruction"),
        ("", ("--causal",), "here 'causal-3'; the frame 'flat' takes any"),
        ('reconstruction = "rk4"', (), "here 'rk4'; the frame 'flat' takes any"),
        ("", ("--vertical", "hold"), "leaves its height free; vertical 'hold' takes one of"),
        ('vertical = "baro"', (), "'flat-euler' leaves its height free; vertical 'baro'"),
        ("", ("--kind", "compensated"), "reconstruction 'euler' needs the rates themselves"),
    ],
)
def test_what_a_flat_world_does_not_take(
    bench: Bench, table: str, options: tuple[str, ...], fact: str
) -> None:
    bench.write(imu_channel(drive()), site=site(table))
    bench.refused(fact, options=("--frame", "flat-euler", *options))


# ---- the vertical channel ----------------------------------------------------------------------


def pressure(height: Array) -> Array:
    """Pressure of the standard atmosphere, Pa, to 11 km (ICAO Doc 7488)."""
    geopotential = 6_356_766.0 * height / (6_356_766.0 + height)
    power = 9.80665 / (287.05287 * 0.0065)
    return 101_325.0 * np.asarray((1.0 - 0.0065 * geopotential / 288.15) ** power)


def barometer(
    height: Array, seconds: Array, topic: str = "/baro", late_s: float = 0.013
) -> Channel:
    """A topic of pressures, made by other people's software; recorded a little late."""
    stamp_ns = EPOCH_NS + np.rint(seconds * 1e9).astype(np.int64)
    schema = "sensor_msgs/msg/FluidPressure"
    types = ROS.types
    messages = []
    for ns, p in zip(stamp_ns.tolist(), pressure(height).tolist(), strict=True):
        time = types["builtin_interfaces/msg/Time"](*divmod(ns, 1_000_000_000))
        header = types["std_msgs/msg/Header"](time, "baro")
        messages.append(bytes(ROS.serialize_cdr(types[schema](header, p, 0.0), schema)))
    text = ROS.generate_msgdef(schema, ros_version=2)[0]
    log_ns = stamp_ns + round(late_s * 1e9)
    return Channel(topic, schema, text, messages, log_ns.tolist())


SECONDS = np.arange(0.0, 21.0, 0.1)
HEIGHTS = 312.0 + 2.0 * np.sin(0.4 * SECONDS)  # m, of a barometer the weather has moved


def test_baro_ties_the_height_to_the_pressure(bench: Bench) -> None:
    """What it writes is what the function returns for the same heights, to the bit."""
    bench.write(
        imu_channel(drive()),
        barometer(HEIGHTS, SECONDS),
        barometer(HEIGHTS + 500.0, SECONDS, "/cabin"),
        site=site('vertical = "baro"', baro='topic = "/baro"\ntime_constant_s = 0.5'),
    )
    out = bench.accepted().out
    assert "vertical baro" in out
    assert "without heights" not in out
    found, provenance = solution(bench.out), bench.provenance()
    assert provenance["vertical"] == "baro"
    assert provenance["samples_unaided"] == "0"
    assert provenance["loop_heights"] == str(len(SECONDS))
    # 3/tau, 3/tau^2 + 2 g/R, 1/tau^3 for 0.5 s
    assert json.loads(provenance["loop_gains"]) == pytest.approx([6.0, 12.0, 8.0], rel=1e-6)

    heights = read_heights(bench.log, "/baro")
    imu = navgrade.read_imu(bench.log, kind="average", axes="FRD")
    alignment = json.loads(provenance["alignment"])
    state = navgrade.NavState(
        t=10.0, lat=45.0 * DEG, lon=8.0 * DEG, h=0.0, q_nb=np.array(alignment["q_nb"])
    )
    loop = BaroLoop(heights.seconds(imu.epoch_ns), heights.h, gains_from_time_constant(0.5))
    nav = navgrade.navigate(imu, state, vertical=loop)
    assert found["height_m"].tobytes() == nav.h.tobytes()
    # m: it follows the barometer, shifted to the height of the site, after 4 s; what it lags is
    # the third derivative, 0.13 m/s^3, times tau^3, and Euler's 0.02 s of up to 0.8 m/s
    t = 10.0 + 0.02 * np.arange(1, 501)
    wanted = np.interp(t, SECONDS, HEIGHTS) - np.interp(10.0, SECONDS, HEIGHTS)
    assert np.abs(found["height_m"] - wanted)[200:].max() < 0.05
    bench.accepted("--overwrite", "--vertical", "free")
    assert np.abs(solution(bench.out)["height_m"] - wanted)[200:].max() > 1.0
    assert "loop_gains" not in bench.provenance()


def test_the_only_pressure_topic_needs_no_naming(bench: Bench) -> None:
    bench.write(imu_channel(drive()), barometer(HEIGHTS, SECONDS), site=site())
    bench.accepted("--vertical", "baro")
    assert bench.provenance()["loop_heights"] == str(len(SECONDS))


def test_reference_and_gains_are_the_site_files(bench: Bench) -> None:
    bench.write(
        imu_channel(drive()),
        barometer(HEIGHTS - 310.0, SECONDS),
        site=site(baro='reference = "absolute"\ngains = "rogers"'),
    )
    bench.accepted("--vertical", "baro")
    # 3 k, 4 k^2 + 2 g/R, 2 k^3 for k = 0.01/s
    assert json.loads(bench.provenance()["loop_gains"]) == pytest.approx(
        [0.03, 4.0308e-4, 2e-6], rel=1e-4
    )
    # m: pulled towards 2 m at 0.03/s from the start
    assert solution(bench.out)["height_m"][0] == pytest.approx(0.03 * 0.02 * 0.75, rel=0.5)


def test_samples_without_heights_are_counted(bench: Bench) -> None:
    keep = (SECONDS < 13.95) | (SECONDS > 16.05)  # 14.0 to 16.0 s are missing
    bench.write(
        imu_channel(drive()),
        barometer(HEIGHTS[keep], SECONDS[keep]),
        site=site('vertical = "baro"'),
    )
    out = bench.accepted().out
    stamp_ns, status = bench.stamps_and_status()
    t = (stamp_ns - EPOCH_NS) * 1e-9
    unaided = (status & UNAIDED) != 0
    assert np.array_equal(unaided, (t > 13.9 + 1e-6) & (t < 16.1 - 1e-6))
    assert bench.provenance()["samples_unaided"] == str(unaided.sum())
    assert f"without heights       {unaided.sum()} samples, the loop coasted" in out


@pytest.mark.parametrize(
    ("baro", "facts"),
    [
        (None, ("no sensor_msgs/msg/FluidPressure topic", "baro.topic", "/imu/data_raw")),
        ('topic = "/barro"', ("/barro", "no such topic", "/imu/data_raw")),
        ('topic = "/imu/data_raw"', ("does not say which number is a height", "baro.field")),
    ],
)
def test_baro_without_heights_is_refused(
    bench: Bench, baro: str | None, facts: tuple[str, ...]
) -> None:
    bench.write(imu_channel(drive()), site=site('vertical = "baro"', baro=baro))
    bench.refused(str(bench.log), *facts)
    bench.accepted("--vertical", "free")  # heights are looked for only where they are needed


def test_several_pressure_topics_want_a_choice(bench: Bench) -> None:
    channels = [barometer(HEIGHTS, SECONDS, topic) for topic in ("/cabin", "/static")]
    bench.write(imu_channel(drive()), *channels, site=site('vertical = "baro"'))
    bench.refused("2 pressure topics", "baro.topic", "/cabin", "/static")


def test_heights_that_come_too_late_to_start_from_say_so(bench: Bench) -> None:
    late = SECONDS > 12.0
    bench.write(
        imu_channel(drive()),
        barometer(HEIGHTS[late], SECONDS[late]),
        site=site('vertical = "baro"'),
    )
    sentence = bench.refused("no height to start from", 'reference "absolute"')
    assert "nothing to navigate" not in sentence
    bench.site.write_text(site('vertical = "baro"', baro='reference = "absolute"'))
    bench.accepted()
    assert int(bench.provenance()["samples_unaided"]) == pytest.approx(104, abs=1)


# ---- gravity -----------------------------------------------------------------------------------


@pytest.mark.parametrize("given", ["option", "site file"])
def test_gravity_is_chosen_by_name(bench: Bench, given: str) -> None:
    """At 5 km Somigliana's formula without the height pulls 15.4 mm/s² too much."""
    bench.write(imu_channel(drive()), site=site(height=5000.0))
    bench.accepted()
    wanted = positions(bench)[-1]
    if given == "option":
        bench.accepted("--overwrite", "--gravity", "somigliana")
    else:
        bench.site.write_text(site('gravity = "somigliana"', height=5000.0))
        bench.accepted("--overwrite")
    assert bench.provenance()["gravity"] == "somigliana"
    # m: dg t^2 / 2 over 10 s, and 0.1 mm for the 10 s of a fall
    np.testing.assert_allclose(last_ned(bench, wanted), [0.0, 0.0, 0.7706], atol=3e-3)
    bench.accepted("--overwrite", "--gravity", "somigliana-taylor")
    assert np.abs(last_ned(bench, wanted)).max() < 3e-3  # m: 4e-5 m/s² of the north component


GRID = """\
lat_deg, lon_deg, xi_arcsec, eta_arcsec, dg_mgal
{south}, 7.5, 60, -40, 200
{south}, 8.5, 60, -40, 200
{north}, 7.5, 60, -40, 200
{north}, 8.5, 60, -40, 200
"""


def test_a_disturbance_grid_lies_beside_the_site_file(bench: Bench) -> None:
    bench.write(imu_channel(drive()), site=site('disturbance = "field/grid.csv"'))
    grid = bench.folder / "field" / "grid.csv"
    bench.refused("site.toml", "mechanization.disturbance", "grid.csv")
    grid.parent.mkdir()
    grid.write_text("lat,lon\n45,8\n")
    bench.refused("mechanization.disturbance", "must begin with the line lat_deg,lon_deg")
    grid.write_text(GRID.format(south=44.5, north=45.5))
    bench.accepted()
    digest = hashlib.sha256(grid.read_bytes()).hexdigest()
    assert bench.provenance()["disturbance_sha256"] == digest
    with_field = positions(bench)[-1]
    bench.site.write_text(site())
    bench.accepted("--overwrite")
    assert "disturbance_sha256" not in bench.provenance()
    # m: -(g xi, g eta, -dg) t^2 / 2; 1 %: the body sways and tilts meanwhile
    pull = np.array([-9.806 * 60.0 * ARCSEC, 9.806 * 40.0 * ARCSEC, 200e-5])
    np.testing.assert_allclose(last_ned(bench, with_field), -50.0 * pull, rtol=0.01)


def test_a_grid_that_does_not_cover_the_journey_ends_it(bench: Bench) -> None:
    """At 250 m/s north the border, 2 km away, is reached after 8 s."""
    text = started_site(velocity=(250.0, 0.0, 0.0))
    bench.write(imu_channel(drive()), site=f'{text}[mechanization]\ndisturbance = "grid.csv"\n')
    (bench.folder / "grid.csv").write_text(GRID.format(south=44.5, north=45.018))
    for frame in MECHANIZATIONS:
        sentence = bench.refused("leaves the disturbance grid", options=("--frame", frame))
        (at,) = re.findall(r"at (\d+\.\d+) s", sentence)
        assert float(at) == pytest.approx(0.018 * 111_131.0 / 250.0, abs=0.1)  # s
    bench.out.write_bytes(b"the work of last week")
    assert bench.run("--overwrite").code == 2
    assert bench.out.read_bytes() == b"the work of last week"
    assert not bench.part.exists()


# ---- compensated increments --------------------------------------------------------------------


def turned(rotations: Array, vectors: Array) -> Array:
    """Vectors turned by the transposes of rotation vectors' matrices (Rodrigues)."""
    angle = np.linalg.norm(rotations, axis=1, keepdims=True)
    axis = rotations / angle
    along = np.sum(axis * vectors, axis=1, keepdims=True) * axis
    across = vectors - along
    back: Array = along + np.cos(angle) * across - np.sin(angle) * np.cross(axis, vectors)
    return back


def test_the_frame_of_compensated_increments_is_declared(bench: Bench) -> None:
    recording = drive()
    start = recording.as_increments(np.full(len(recording), 1.0 / RATE))
    end = replace(start, accel=turned(start.gyro, start.accel))
    solutions = {}
    for name, log in (("start", start), ("end", end)):
        text = started_site(velocity=(3.0, 1.0, 0.0))
        text = text.replace('"average"', f'"compensated"\ndv_frame = "{name}"')
        bench.write(imu_channel(log), site=text)
        bench.accepted("--overwrite")
        assert bench.provenance()["dv_frame"] == name
        solutions[name] = positions(bench)
    # m: rounding
    assert np.abs(solutions["end"] - solutions["start"]).max() < 1e-7
    bench.site.write_text(bench.site.read_text().replace('dv_frame = "end"\n', ""))
    bench.accepted("--overwrite")
    assert bench.provenance()["dv_frame"] == "start"
    # m: taken at the wrong end, increments are turned by up to 2 deg/s times 20 ms
    assert np.abs(positions(bench) - solutions["start"]).max() > 5e-3
    bench.site.write_text(text.replace('"end"', '"middle"'))
    bench.out.unlink()
    bench.refused("imu.dv_frame", "'middle'", "start, end")


# ---- gaps --------------------------------------------------------------------------------------


def test_windows_between_gaps_are_told(bench: Bench) -> None:
    """Five samples are left between two gaps of half a second, where nine are wanted."""
    recording = drive().without(600, 25).without(605, 25)
    bench.write(imu_channel(recording), site=site())
    bench.refused("without samples after", "--bridge-gaps")
    out = bench.accepted("--bridge-gaps").out
    stamp_ns, status = bench.stamps_and_status()
    t = np.rint((stamp_ns - EPOCH_NS) * 1e-9 * RATE).astype(int)  # numbers of the samples
    assert t.tolist() == list(range(501, 1001))
    bridged, short = (status & BRIDGED) != 0, (status & SHORT) != 0
    assert t[bridged].tolist() == [*range(600, 625), *range(630, 655)]
    assert t[short].tolist() == list(range(625, 630))
    assert "gaps bridged          2: 0.500 s at 11.980 s, 0.500 s at 12.580 s" in out
    assert "short windows         5 (too few samples between gaps)" in out
    found = bench.provenance()
    counts = [found[f"samples_{name}"] for name in ("bridged", "short_window", "unaided")]
    assert counts == ["50", "5", "0"]
    # four at each side of the gaps and four at the end
    assert found["samples_shifted_window"] == str(((status & SHIFTED) != 0).sum())
    out = bench.accepted("--bridge-gaps", "--overwrite", "--causal").out
    # three previous samples are missing at the start of each of five stretches but the first
    assert "short windows         12 " in out
    out = bench.accepted("--bridge-gaps", "--overwrite", "--reconstruction", "none").out
    assert "short windows" not in out


# ---- names -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "wrong", "near"),
    [
        ("reconstruction", "centered-9", "centred-9"),
        ("reconstruction", "samples2", "samples-2"),
        ("frame", "ecef", "e"),
        ("vertical", "barro", "baro"),
        ("gravity", "somiglana", "somigliana"),
        ("gravity", "closed", "closed-form"),
    ],
)
def test_an_unknown_name_suggests_the_nearest(
    bench: Bench, name: str, wrong: str, near: str
) -> None:
    bench.write(imu_channel(drive()), site=site())
    facts = (f"{name} '{wrong}' is not one of", f"did you mean '{near}'?")
    sentence = bench.refused(*facts, options=(f"--{name}", wrong))
    assert "site.toml" not in sentence
    bench.site.write_text(site(f'{name} = "{wrong}"'))
    bench.refused("site.toml", *facts)
    bench.accepted(f"--{name}", near) if near != "baro" else None


def test_options_stand_above_the_site_file(bench: Bench) -> None:
    table = """\
reconstruction = "causal-0"
frame = "e"
vertical = "hold"
gravity = "somigliana"
"""
    bench.write(imu_channel(drive()), site=site(table))
    bench.accepted()
    keys = ("reconstruction", "frame", "vertical", "gravity")
    found = bench.provenance()
    assert [found[key] for key in keys] == ["causal-0", "e", "hold", "somigliana"]
    options = ("--reconstruction", "samples-3", "--frame", "w", "--vertical", "free")
    bench.accepted("--overwrite", *options, "--gravity", "closed-form")
    found = bench.provenance()
    assert [found[key] for key in keys] == ["samples-3", "w", "free", "closed-form"]
