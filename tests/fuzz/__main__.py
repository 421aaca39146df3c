"""``python -m tests.fuzz [read|kill] --count N --seed S``: see the modules of this package."""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
import time
from pathlib import Path

from tests.fuzz.corpus import corpus
from tests.fuzz.harness import Report, case, fuzz
from tests.fuzz.judge import by_navgrade
from tests.fuzz.kill import finish, kill


def _save(report: Report, seed: int) -> Path:
    """The inputs that failed, as files."""
    folder = Path(tempfile.mkdtemp(prefix="navgrade-fuzz-"))
    samples = corpus()
    for index, verdict in report.failures.items():
        name = f"{seed}-{index}-{verdict.outcome.replace(' ', '-')}.mcap"
        (folder / name).write_bytes(case(seed, index, samples).mutant.data)
    return folder


def read(count: int, seed: int, jobs: int) -> int:
    """Mutated logs through the reader."""
    began = time.perf_counter()
    report = fuzz(count, seed, jobs, by_navgrade)
    seconds = time.perf_counter() - began
    print(f"{count} mutated logs, seed {seed}, {seconds:.0f} s, {count / seconds:.0f} a second")
    for outcome, number in report.outcomes.most_common():
        print(f"  {outcome:16} {number:8}")
    samples = corpus()
    longest, index = report.slowest
    print(f"slowest: {longest * 1e3:.0f} ms, {case(seed, index, samples).name}")
    if not report.failures:
        return 0
    for index, verdict in sorted(report.failures.items())[:20]:
        print(f"\n{verdict.outcome}, {case(seed, index, samples).name}\n{verdict.story}")
    print(f"\n{len(report.failures)} failures, their inputs in {_save(report, seed)}")
    return 1


def killed(count: int, seed: int) -> int:
    """Runs of a log of five minutes, killed while they write."""
    folder = Path(tempfile.mkdtemp(prefix="navgrade-kill-"))
    print(f"in {folder}, which stays when a run leaves what it must not")
    found = kill(*finish(folder, seconds=300.0), count, seed)
    shutil.rmtree(folder)
    print(f"{count} runs killed while they wrote, seed {seed}; they left")
    for what, number in found.most_common():
        print(f"  {what:28} {number:4}")
    return 0


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("what", nargs="?", choices=["read", "kill"], default="read")
    parser.add_argument("--count", type=int, help="100000 logs, or 50 runs, by default")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2, help="processes that read")
    options = parser.parse_args()
    if options.what == "kill":
        return killed(options.count or 50, options.seed)
    return read(options.count or 100_000, options.seed, options.jobs)


if __name__ == "__main__":
    sys.exit(main())
