"""``navgrade run`` writes what `navgrade.navigate` computes, and says what it did."""

from __future__ import annotations

import hashlib
import json
import math
import re
from importlib.metadata import version

import numpy as np
import pytest
from mcap.reader import make_reader

import navgrade
from navgrade.logs import open_imu
from navgrade.site import read_site
from tests.navgrade.cli.calling import Bench
from tests.navgrade.cli.calling import navgrade as call
from tests.navgrade.logmaking import (
    EPOCH_NS,
    SITE,
    Recording,
    from_body_axes,
    imu_channel,
    resting,
    stamps,
    started_site,
)
from tests.navgrade.logs.decoding import DECODERS, fixes, solution

RATE = 50.0  # Hz
DEG = math.pi / 180.0  # rad


def drive(seconds: float = 20.0) -> Recording:
    """At rest for the alignment window, then moving."""
    return resting(seconds, RATE, sway_from_s=10.5)


def long_drive(kind: str) -> Recording:
    """20,000 samples with jitter and a hole: more than one block of the reader."""
    recording = resting(20_000 / 200.0, 200.0, sway_from_s=0.0)
    stamp_ns = stamps(len(recording), 200.0, jitter_s=2e-4)
    moved = Recording(stamp_ns, recording.gyro, recording.accel)
    if kind in ("increment", "compensated"):
        moved = moved.as_increments(np.diff(stamp_ns, prepend=stamp_ns[0] - 5_000_000) * 1e-9)
    return moved.without(9_000, 50)


@pytest.mark.parametrize(
    ("kind", "reconstruction", "vertical", "decoder"),
    [
        ("rate", "causal-3", "free", "rosbags"),
        ("average", "causal-1", "hold", "rosbags"),
        ("increment", "causal-3", "free", "mcap-ros2-support"),
        ("compensated", "none", "free", "rosbags"),
        ("rate", "centred-9", "free", "mcap-ros2-support"),
    ],
)
def test_the_file_holds_what_navigate_returns_to_the_bit(
    bench: Bench, kind: str, reconstruction: str, vertical: str, decoder: str
) -> None:
    """The command streams in blocks, the function has all samples at once."""
    start_ns = EPOCH_NS + 2_002_000_000  # inside an interval
    site = started_site(start_ns, velocity=(3.0, 1.0, 0.0))
    bench.write(imu_channel(long_drive(kind)), site=site, chunk_bytes=50_000)
    assert len(next(open_imu(bench.log, kind=kind).blocks())) < 19_000
    bench.accepted(
        "--kind", kind, "--reconstruction", reconstruction, "--vertical", vertical, "--bridge-gaps"
    )

    imu = navgrade.read_imu(bench.log, kind=kind, axes="FRD")
    initial = read_site(bench.site).initial
    assert initial is not None
    given = initial.state
    state = navgrade.NavState(
        t=(start_ns - EPOCH_NS) * 1e-9,
        lat=given.lat,
        lon=given.lon,
        h=given.h,
        v_eb_n=given.v_eb_n,
        q_nb=given.q_nb,
    )
    nav = navgrade.navigate(
        imu, state, reconstruction=reconstruction, vertical=vertical, bridge_gaps=True
    )
    found = solution(bench.out, DECODERS[decoder])
    exact = {
        "height_m": nav.h,
        "v_north_m_s": nav.v_eb_n[:, 0],
        "v_east_m_s": nav.v_eb_n[:, 1],
        "v_down_m_s": nav.v_eb_n[:, 2],
        "orientation.w": nav.q_nb[:, 0],
        "orientation.x": nav.q_nb[:, 1],
        "orientation.y": nav.q_nb[:, 2],
        "orientation.z": nav.q_nb[:, 3],
    }
    for name, values in exact.items():
        assert found[name].tobytes() == np.ascontiguousarray(values).tobytes(), name
    assert found["status"].tolist() == nav.status.tolist()
    assert (np.asarray(nav.status) & 1).sum() == 50
    # one division by pi/180 from the radians: 1 ulp, 1e-14 deg
    for name, radians in (("latitude_deg", nav.lat), ("longitude_deg", nav.lon)):
        wanted = radians / DEG
        assert np.all(np.abs(found[name] - wanted) <= np.spacing(np.abs(wanted))), name
    recorded = long_drive(kind).stamp_ns
    after = recorded[recorded > start_ns]
    assert np.array_equal(found["stamp_ns"][found["status"] & 1 == 0], after)


@pytest.mark.parametrize("axes", ["FRD", "FLU", "RFU", "URF"])
def test_axes_do_not_change_the_solution(bench: Bench, axes: str) -> None:
    site = SITE.replace('"FRD"', f'"{axes}"')
    bench.write(imu_channel(from_body_axes(drive(), axes)), site=site)
    bench.accepted()
    found = solution(bench.out)
    bench.write(imu_channel(drive()), site=SITE)
    bench.accepted("--overwrite")
    wanted = solution(bench.out)
    for name in wanted:
        assert found[name].tobytes() == wanted[name].tobytes(), name


def test_alignment_finds_the_attitude_put_in(bench: Bench) -> None:
    """Exact Earth rate and gravity at 45 deg; gravity is known there to 1 µm/s^2."""
    bench.write(imu_channel(drive()), site=SITE)
    bench.accepted()
    first = bench.messages()[0]
    # direction needs no magnitude of gravity: rounding only, 1e-9 deg after one 20 ms step
    assert first.roll_deg == pytest.approx(2.0, abs=1e-8)
    assert first.pitch_deg == pytest.approx(-3.0, abs=1e-8)
    assert first.heading_deg == pytest.approx(70.0, abs=1e-6)
    assert first.header.stamp.sec * 10**9 + first.header.stamp.nanosec == EPOCH_NS + 10_020_000_000


def test_provenance_says_where_it_came_from(bench: Bench) -> None:
    bench.write(imu_channel(drive(), "/imu/mast"), site=SITE)
    bench.accepted("--reconstruction", "causal-1", "--vertical", "hold")
    found = bench.provenance()
    wanted = {
        "version": version("navgrade"),
        "input": "drive.mcap",
        "input_sha256": hashlib.sha256(bench.log.read_bytes()).hexdigest(),
        "topic": "/imu/mast",
        "schema": "sensor_msgs/msg/Imu",
        "kind": "average",
        "axes": "FRD",
        "reconstruction": "causal-1",
        "frame": "n",
        "vertical": "hold",
        "gravity": "closed-form",
        "ellipsoid": "WGS84",
        "dv_frame": "start",
        "samples": "500",
        "gaps": "0",
        "defects": "0",
        "samples_bridged": "0",
        "samples_stretched": "0",
        "samples_short_window": "0",
        "samples_shifted_window": "0",
        "samples_unaided": "0",
    }
    assert {key: found.get(key) for key in wanted} == wanted
    alignment = json.loads(found["alignment"])
    assert alignment["method"] == "triad"
    for name in ("roll", "pitch", "heading"):
        assert 0.0 < alignment[f"{name}_sigma_deg"] < 1.0
        assert math.isfinite(alignment[f"{name}_deg"])


@pytest.mark.parametrize("site", [SITE, started_site()], ids=["site", "initial"])
def test_the_site_file_is_attached_byte_by_byte(bench: Bench, site: str) -> None:
    bench.write(imu_channel(drive()))
    content = (site + "# Überhöhung 北京\r\n").encode()
    bench.site.write_bytes(content)
    bench.accepted()
    with bench.out.open("rb") as stream:
        (attachment,) = make_reader(stream).iter_attachments()
    assert attachment.name == "site.toml"
    assert attachment.media_type == "application/toml"
    assert attachment.data == content


def test_the_command_line_stands_above_the_site_file(bench: Bench) -> None:
    site = SITE.replace(
        "[alignment]",
        '[mechanization]\nreconstruction = "none"\nvertical = "free"\nframe = "n"\n[alignment]',
    )
    bench.write(imu_channel(drive()), site=site)
    bench.accepted()
    assert bench.provenance()["reconstruction"] == "none"
    bench.accepted(
        "--overwrite", "--reconstruction", "causal-1", "--kind", "rate", "--vertical", "hold"
    )
    found = bench.provenance()
    chosen = [found[key] for key in ("reconstruction", "kind", "vertical")]
    assert chosen == ["causal-1", "rate", "hold"]
    assert set(solution(bench.out)["height_m"]) == {0.0}


@pytest.mark.parametrize(("rate", "count", "fix_count"), [("1", 10, 100), ("10", 100, 100)])
def test_output_rate_thins_the_solution_and_not_the_fixes(
    bench: Bench, rate: str, count: int, fix_count: int
) -> None:
    bench.write(imu_channel(drive()), site=SITE)
    bench.accepted()
    every = solution(bench.out)
    bench.accepted("--overwrite", "--output-rate", rate)
    thinned = solution(bench.out)
    assert abs(len(thinned["stamp_ns"]) - count) <= 1
    assert abs(len(fixes(bench.out)["stamp_ns"]) - fix_count) <= 1
    at = np.searchsorted(every["stamp_ns"], thinned["stamp_ns"])
    for name in every:
        assert every[name][at].tobytes() == thinned[name].tobytes(), name


def test_a_higher_output_rate_than_the_log_has_gives_every_sample(bench: Bench) -> None:
    bench.write(imu_channel(drive()), site=SITE)
    bench.accepted("--output-rate", "1000")
    assert len(solution(bench.out)["stamp_ns"]) == 500


def test_overwrite_replaces(bench: Bench) -> None:
    bench.write(imu_channel(drive()), site=SITE)
    bench.out.write_bytes(b"old")
    bench.accepted("--overwrite")
    assert len(solution(bench.out)["stamp_ns"]) == 500


def test_runs_of_the_same_input_give_the_same_messages(bench: Bench) -> None:
    bench.write(imu_channel(drive()), site=SITE)
    bench.accepted()
    first = bench.out.read_bytes()
    bench.accepted("--overwrite")
    assert bench.out.read_bytes() == first


def test_a_part_left_by_a_killed_run_is_in_nobodys_way(bench: Bench) -> None:
    bench.write(imu_channel(drive()), site=SITE)
    bench.part.write_bytes(b"half of something")
    bench.accepted()
    assert len(solution(bench.out)["stamp_ns"]) == 500


# ---- what is said ------------------------------------------------------------------------------


def test_the_summary_tells_what_was_done(bench: Bench) -> None:
    bench.write(imu_channel(drive()), site=SITE)
    out = bench.accepted().out
    last = bench.messages()[-1]
    assert "sensor_msgs/msg/Imu, kind average, axes FRD" in out
    for name in ("roll", "pitch", "heading"):
        assert re.search(rf"^{name} +-?\d+\.\d+° +1σ \d+\.\d+°$", out, re.MULTILINE)
    assert "500 over 10.000 s" in out
    assert re.search(r"gaps bridged +0$", out, re.MULTILINE)
    assert f"{last.latitude_deg:.9f}°  {last.longitude_deg:.9f}°  {last.height_m:.4f} m" in out
    assert f"N {last.v_north_m_s:.5f}  E {last.v_east_m_s:.5f}  D {last.v_down_m_s:.5f} m/s" in out
    assert f"heading {last.heading_deg:.5f}°" in out
    assert re.search(r"speed +[\d,]+ samples/s", out)
    assert str(bench.out) in out


def test_axes_nobody_gave_are_said_aloud(bench: Bench) -> None:
    site = SITE.replace('axes = "FRD"\n', "")
    bench.write(imu_channel(from_body_axes(drive(), "FLU")), site=site)
    assert "axes FLU (nobody said: the ROS default)" in bench.accepted().out
    assert bench.provenance()["axes"] == "FLU"
    assert "nobody said" not in bench.accepted("--overwrite", "--axes", "FLU").out


def test_brackets_in_a_path_are_printed_as_they_are(bench: Bench) -> None:
    folder = bench.folder / "logs [raw]"
    folder.mkdir()
    inner = Bench(folder).write(imu_channel(drive()), site=SITE)
    assert str(inner.log) in inner.accepted().out


# ---- help --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ((), ("run", "align", "inspect", "--version")),
        (
            ("run",),
            (
                *("LOG.mcap", "--config", "--output", "--imu-topic", "--kind", "--axes"),
                *("--frame", "--reconstruction", "--vertical", "--output-rate", "--overwrite"),
                *("--bridge-gaps", "--strict", "--causal", "--gravity", "causal-3", "centred-9"),
                *("free", "hold", "baro", "somigliana", "closed-form"),
                *("--pose-rate", "--location-fix", "--copy-topics"),
            ),
        ),
        (("align",), ("LOG.mcap", "--config", "--imu-topic", "--kind", "--axes", "--json")),
        (("inspect",), ("LOG.mcap",)),
    ],
)
@pytest.mark.parametrize("option", ["--help", "-h"])
def test_help_names_every_option(
    command: tuple[str, ...], words: tuple[str, ...], option: str
) -> None:
    outcome = call(*command, option)
    assert outcome.code == 0
    assert outcome.err == ""
    for word in words:
        assert word in outcome.out


def test_version_is_that_of_the_package() -> None:
    outcome = call("--version")
    assert outcome.code == 0
    assert version("navgrade") in outcome.out


def test_the_example_in_the_help_of_axes_is_accepted(bench: Bench) -> None:
    text = " ".join(call("run", "--help").out.split())
    (example,) = re.findall(r"'(x=[^']+)'", text)
    bench.write(imu_channel(drive()), site=started_site(velocity=(1.0, 0.0, 0.0)))
    bench.accepted("--axes", example)


@pytest.mark.parametrize(
    "arguments", [("run",), ("run", "--nonsense"), ("fly",), ("run", "x.mcap", "-o", "y.mcap")]
)
def test_a_wrong_call_shows_the_usage(arguments: tuple[str, ...]) -> None:
    outcome = call(*arguments)
    assert outcome.code == 2
    assert outcome.err.startswith("Usage: navgrade")
    assert "Traceback" not in outcome.err


def test_a_log_at_a_url_is_navigated_like_a_file(bench: Bench) -> None:
    fsspec = pytest.importorskip("fsspec", reason="fsspec is not installed: extra `remote`")
    bench.write(imu_channel(resting(20.0, sway_from_s=10.5)), site=SITE)
    bench.accepted()
    expected, _ = bench.stamps_and_status()
    last = bench.messages()[-1]
    fsspec.filesystem("memory").pipe("/drive.mcap", bench.log.read_bytes())
    url = "memory://drive.mcap"
    outcome = call("run", url, "-c", bench.site, "-o", bench.out, "--overwrite")
    assert outcome.code == 0, outcome
    assert np.array_equal(bench.stamps_and_status()[0], expected)
    assert str(bench.messages()[-1]) == str(last)
    for command in (("inspect", url), ("align", url, "-c", bench.site)):
        assert call(*command).code == 0
