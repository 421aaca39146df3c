"""What is found does not depend on where the blocks end that a log is read in."""

from __future__ import annotations

import numpy as np
import pytest

from navgrade.logs.stamps import SequenceAudit, StampAudit
from tests.navgrade.logmaking import EPOCH_NS

STEP_NS = 10_000_000
COUNT = 3000


def faulty() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stamps, log times and sequence numbers with a fault of every sort, several at one place."""
    rng = np.random.default_rng(3)
    log_ns = EPOCH_NS + STEP_NS * np.arange(COUNT)
    stamp_ns = log_ns.copy()
    for at in rng.choice(np.arange(1100, COUNT), 40, replace=False):
        stamp_ns[at] = stamp_ns[at - 1]
    stamp_ns[1500:] += 5 * STEP_NS
    stamp_ns[1700] -= 3 * STEP_NS
    stamp_ns[2000:] += 3600 * 10**9
    stamp_ns[2500:] -= 1_000 << 32
    sequence = np.arange(65_000, 65_000 + COUNT)
    sequence[2200:] += 7
    return stamp_ns, log_ns, (sequence % 65_536).astype(np.uint32)


@pytest.mark.parametrize("size", [1001, 1500, 2001])
def test_blocks_change_nothing(size: int) -> None:
    """The first one is long enough to tell the interval."""
    stamp_ns, log_ns, sequence = faulty()
    whole, parts = StampAudit("stamp"), StampAudit("stamp")
    counted, counted_parts = SequenceAudit(), SequenceAudit()
    whole.add(stamp_ns, log_ns, follows=True)
    counted.add(sequence, follows=True)
    cuts = [size, *range(size + 1, COUNT, 7)]
    for rows in np.split(np.arange(COUNT), cuts):
        parts.add(stamp_ns[rows], log_ns[rows], follows=True)
        counted_parts.add(sequence[rows], follows=True)
    assert parts.report() == whole.report()
    assert counted_parts.report() == counted.report()
    found = whole.report()
    assert found["repeats"] > 30
    assert found["gaps"]["count"] >= 1
    assert found["backward_steps"]["count"] >= 1
    assert found["jumps"]["count"] == found["wraps"]["count"] == 1
    assert counted.report() == {"skipped": 7, "steps_back": 0, "wraps": 1}


def test_what_does_not_follow_is_not_compared() -> None:
    """The beginning and the end of a log, read alone, have no gap between them."""
    stamps = EPOCH_NS + STEP_NS * np.arange(COUNT)
    found, counted = StampAudit("stamp"), SequenceAudit()
    for rows in (slice(0, 100), slice(2900, None)):
        found.add(stamps[rows], stamps[rows], follows=False)
        counted.add(np.arange(COUNT, dtype=np.uint32)[rows], follows=False)
    assert found.gaps.count == found.jumps.count == 0
    assert (found.first_ns, found.last_ns) == (stamps[0], stamps[-1])
    assert counted.skipped == 0


def test_of_many_places_the_first_twenty_are_kept() -> None:
    stamps = EPOCH_NS + STEP_NS * np.arange(COUNT)
    stamps[1:] += 10 * STEP_NS * (np.arange(1, COUNT) // 50)
    found = StampAudit("stamp")
    for rows in np.split(np.arange(COUNT), 30):
        found.add(stamps[rows], stamps[rows], follows=True)
    assert found.gaps.count == COUNT // 50 - 1
    assert len(found.gaps.first) == 20
    at, length = found.gaps.first[1]
    assert at == pytest.approx((stamps[99] - stamps[0]) * 1e-9)
    assert length == pytest.approx(10 * STEP_NS * 1e-9)
