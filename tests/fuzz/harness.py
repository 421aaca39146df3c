"""Many mutated logs through a reader, in processes that a hang or a crash cannot stop."""

from __future__ import annotations

import faulthandler
import multiprocessing
import resource
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from random import Random

from navgrade.errors import NavgradeError
from tests.fuzz.corpus import Sample, corpus
from tests.fuzz.judge import GOOD, ROUTES, How, Reader, Verdict, choose, examine
from tests.fuzz.mutate import Mutant, mutated


@dataclass(frozen=True)
class Limits:
    """What one file of a few kilobytes may take."""

    seconds: float = 10.0
    megabytes: float = 640.0  # beyond what it has: two chunks of the largest size unpacked


@dataclass(frozen=True)
class Case:
    """A mutated log and how it is read, the same for each seed and index."""

    index: int
    sample: Sample
    mutant: Mutant
    how: How

    @property
    def name(self) -> str:
        return f"{self.index}: {self.sample.name}, {', '.join(self.mutant.steps)}, {self.how}"


def case(seed: int, index: int, samples: list[Sample]) -> Case:
    """The case of a seed with this index."""
    rng = Random(seed << 32 | index)
    sample = rng.choice(samples)
    how = choose(rng, sample)
    return Case(index, sample, mutated(rng, sample.data), how)


@dataclass
class Report:
    """Outcomes of a run; failures carry the story of the case."""

    outcomes: Counter[str] = field(default_factory=Counter)
    failures: dict[int, Verdict] = field(default_factory=dict)
    slowest: tuple[float, int] = (0.0, 0)  # s, index

    def add(self, index: int, verdict: Verdict, seconds: float) -> None:
        self.outcomes[verdict.outcome] += 1
        self.slowest = max(self.slowest, (seconds, index))
        if verdict.outcome not in GOOD:
            self.failures[index] = verdict


def _memory(key: str) -> float:
    """A line of /proc/self/status, MB."""
    text = Path("/proc/self/status").read_text()
    return int(text.split(f"{key}:")[1].split()[0]) / 1024.0


def _work(pipe: Connection, reader: Reader, seed: int, indices: range, limits: Limits) -> None:
    """Judge cases and send their outcomes; the watch-dog ends this process on a hang."""
    samples = corpus()
    for sample in samples:  # what is compiled and loaded at first use is not the file's doing
        for route in ROUTES:
            with suppress(NavgradeError):
                reader(sample.data, sample, How(route))
    pipe.send("ready")
    first = _memory("VmHWM")
    ceiling = int(_memory("VmSize") + 4.0 * limits.megabytes) << 20
    resource.setrlimit(resource.RLIMIT_AS, (ceiling, ceiling))
    for index in indices:
        one = case(seed, index, samples)
        faulthandler.dump_traceback_later(limits.seconds, exit=True)
        began = time.perf_counter()
        verdict = examine(one.mutant, one.sample, one.how, reader)
        seconds = time.perf_counter() - began
        faulthandler.cancel_dump_traceback_later()
        grown = _memory("VmHWM") - first
        if grown > limits.megabytes:
            verdict = Verdict("memory", f"grew by {grown:.0f} MB")
        pipe.send((index, verdict, seconds))
        if grown > limits.megabytes:
            return


def fuzz(count: int, seed: int, jobs: int, reader: Reader, limits: Limits | None = None) -> Report:
    """Judge the first `count` cases of a seed.

    `reader` is imported by its name in processes of their own.
    """
    report = Report()
    for index, verdict, seconds in _outcomes(count, seed, jobs, reader, limits or Limits()):
        report.add(index, verdict, seconds)
    return report


def _outcomes(
    count: int, seed: int, jobs: int, reader: Reader, limits: Limits
) -> Iterator[tuple[int, Verdict, float]]:
    context = multiprocessing.get_context("spawn")
    workers: dict[Connection, tuple[BaseProcess, range]] = {}

    def start(indices: range) -> None:
        if indices:
            mine, theirs = context.Pipe(duplex=False)
            arguments = (theirs, reader, seed, indices, limits)
            process = context.Process(target=_work, args=arguments, daemon=True)
            process.start()
            theirs.close()
            try:
                mine.recv()
            except EOFError:
                raise RuntimeError("the reader fails on valid logs; see above") from None
            workers[mine] = process, indices

    for job in range(jobs):
        start(range(job, count, jobs))
    while workers:
        for pipe in wait(list(workers)):
            assert isinstance(pipe, Connection)
            process, left = workers[pipe]
            try:
                index, verdict, seconds = pipe.recv()
                workers[pipe] = process, left[1:]
                yield index, verdict, seconds
            except EOFError:
                del workers[pipe]
                process.join()
                if process.exitcode:  # the case it was at ended it: the watch-dog exits with 1
                    outcome = "hang" if process.exitcode == 1 else "crash"
                    yield left[0], Verdict(outcome, f"exit code {process.exitcode}"), 0.0
                    left = left[1:]
                start(left)
