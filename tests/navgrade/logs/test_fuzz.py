"""No mutated log hangs or crashes the reader, or makes it give a wrong number as good.

The long run is ``python -m tests.fuzz``.
"""

from __future__ import annotations

import io
import os
import time
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from navgrade.logs.container import McapFile, chunks
from tests.fuzz.corpus import Sample, corpus
from tests.fuzz.harness import Limits, case, fuzz
from tests.fuzz.judge import GOOD, ROUTES, How, Reader, Reading, by_navgrade, examine
from tests.fuzz.mutate import Mutant
from tests.navgrade.logmaking import EPOCH_NS

SAMPLES = corpus()
FOLDER = Path(__file__).resolve().parents[2] / "fuzz" / "cases"


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize("sample", SAMPLES, ids=lambda sample: sample.name)
def test_what_mutations_start_from_is_read_whole(sample: Sample, route: str) -> None:
    verdict = examine(Mutant([sample.data]), sample, How(route, strict=True), by_navgrade)
    assert verdict.outcome == "whole", verdict.story


def test_mutated_logs_do_no_harm() -> None:
    report = fuzz(1_000, seed=2, jobs=2, reader=by_navgrade)
    assert not report.failures, next(iter(report.failures.items()))
    assert sum(report.outcomes.values()) == 1_000
    assert set(report.outcomes) == set(GOOD)


CASES = {  # that once did harm: what they were made from
    "data-end-twice": "no summary",
    "chunk-of-another-kind": "one imu",
    "footer-among-messages": "unchunked",
    "message-index-without-end": "mixed none",
    "flipped-outside-chunks": "unchunked",
    "chunk-as-message": "mixed lz4",
    "chunk-of-terabytes": "one imu",
    "chunk-behind-the-end": "no message index",
}


@pytest.mark.parametrize("remote", [False, True])
@pytest.mark.parametrize("windowed", [False, True])
@pytest.mark.parametrize("route", ["columns", "messages"])
@pytest.mark.parametrize("name", CASES)
def test_what_once_did_harm_does_none(name: str, route: str, windowed: bool, remote: bool) -> None:
    sample = next(sample for sample in SAMPLES if sample.name == CASES[name])
    data = (FOLDER / f"{name}.mcap").read_bytes()
    window = (EPOCH_NS + 30_000_000, EPOCH_NS + 80_000_000) if windowed else None
    how = How(route, window=window, remote=remote)
    verdict = examine(Mutant([data]), sample, how, by_navgrade)
    assert verdict.outcome in GOOD, verdict.story
    if not (windowed or remote):  # these need not come by the damage
        assert verdict.outcome != "whole"


def test_a_seed_gives_the_same_cases() -> None:
    once, again = (case(3, 41, SAMPLES) for _ in range(2))
    assert once.mutant.data == again.mutant.data
    assert once.how == again.how
    assert once.mutant.data != case(3, 42, SAMPLES).mutant.data


# ---- the harness can fail ----------------------------------------------------------------------


def by_official(data: bytes, sample: Sample, how: How) -> Reading:
    """The official reader as it comes: it verifies no checksum."""
    rows = [
        (channel.topic, message.sequence, message.log_time, message.publish_time, message.data)
        for _, channel, message in make_reader(io.BytesIO(data)).iter_messages()
    ]
    return Reading(rows)


def hanging(data: bytes, sample: Sample, how: How) -> Reading:
    """A reader that damage sends round in circles."""
    time.sleep(0.0 if data == sample.data else 60.0)
    return by_navgrade(data, sample, how)


def crashing(data: bytes, sample: Sample, how: How) -> Reading:
    """A reader that takes the whole process with it."""
    if data != sample.data:
        os.abort()
    return by_navgrade(data, sample, how)


def hoarding(data: bytes, sample: Sample, how: How) -> Reading:
    """A reader that takes memory for damage."""
    if data != sample.data:
        np.ones(50 << 20, np.uint8)
    return by_navgrade(data, sample, how)


def losing(data: bytes, sample: Sample, how: How) -> Reading:
    """A reader that forgets the last message."""
    reading = by_navgrade(data, sample, how)
    reading.rows, reading.columns = reading.rows[:-1], reading.columns[:-1]
    return reading


@pytest.mark.parametrize(
    ("reader", "count", "limits", "outcomes"),
    [
        (by_official, 60, Limits(), {"wrong value", "foreign error"}),
        (losing, 40, Limits(), {"silent loss"}),
        (hanging, 2, Limits(seconds=0.5), {"hang"}),
        (crashing, 2, Limits(), {"crash"}),
        (hoarding, 2, Limits(megabytes=30.0), {"memory"}),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_a_bad_reader_is_found_out(
    reader: Reader, count: int, limits: Limits, outcomes: set[str]
) -> None:
    """And the cases after it are still judged."""
    report = fuzz(count, 4, 1, reader, limits)
    assert sum(report.outcomes.values()) == count
    assert outcomes <= {verdict.outcome for verdict in report.failures.values()}


def test_a_reader_without_checksums_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its own code: of every chunk it is said that no sum is given, that of the data is left."""
    parse = chunks.ChunkHead.parse
    monkeypatch.setattr(chunks.ChunkHead, "parse", lambda content: parse(content)._replace(crc=0))
    monkeypatch.setattr(McapFile, "_check_data", lambda *_: None)
    cases = [case(5, index, SAMPLES) for index in range(400)]
    found = {examine(c.mutant, c.sample, c.how, by_navgrade).outcome for c in cases}
    assert "wrong value" in found
