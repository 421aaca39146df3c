"""A run that is killed leaves no output that is not whole, and a part that can be read.

Fifty moments: ``python -m tests.fuzz kill``.
"""

from __future__ import annotations

import struct
from dataclasses import replace
from pathlib import Path

import pytest

from tests.fuzz.kill import Run, Topics, finish, kill, left_behind
from tests.navgrade.logmaking import chunks_of

TOPIC = "/navgrade/solution"


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Run, Topics]:
    """A run that was not killed."""
    return finish(tmp_path_factory.mktemp("kill"), seconds=60.0)


@pytest.fixture
def another(tmp_path: Path, finished: tuple[Run, Topics]) -> Run:
    """The same run, with a copy of its output."""
    run = replace(finished[0], out=tmp_path / "nav.mcap")
    run.out.write_bytes(finished[0].out.read_bytes())
    return run


def cut(run: Run) -> None:
    """Leave only a part of the output, cut in its third chunk."""
    chunk = chunks_of(run.out)[2]
    run.part.write_bytes(run.out.read_bytes()[: chunk.start + chunk.length // 2])
    run.out.unlink()


def test_what_may_be_left_is_accepted(another: Run, finished: tuple[Run, Topics]) -> None:
    assert left_behind(another, finished[1]) == "the whole output"
    cut(another)
    assert left_behind(another, finished[1]) == "a part with whole chunks"
    another.clear()
    assert left_behind(another, finished[1]) == "nothing"


def test_an_output_without_its_end_is_found_out(another: Run, finished: tuple[Run, Topics]) -> None:
    another.out.write_bytes(another.out.read_bytes()[:-100])
    with pytest.raises((AssertionError, EOFError, struct.error)):
        left_behind(another, finished[1])


def test_a_part_that_differs_from_the_whole_run_is_found_out(
    another: Run, finished: tuple[Run, Topics]
) -> None:
    cut(another)
    rows = list(finished[1][TOPIC])
    sequence, log_ns, publish_ns, data = rows[100]
    rows[100] = sequence, log_ns, publish_ns, data[:-1] + b"?"
    with pytest.raises(AssertionError, match="differs from the whole run"):
        left_behind(another, {**finished[1], TOPIC: rows})


def test_a_killed_run_leaves_what_it_had_written(finished: tuple[Run, Topics]) -> None:
    found = kill(*finished, count=3, seed=1)
    for seed in range(2, 6):  # on a busy machine the end may come before the kill
        if found["a part with whole chunks"]:
            break
        found += kill(*finished, count=3, seed=seed)
    assert found["a part with whole chunks"] > 0
