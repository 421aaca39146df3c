"""Break the code on purpose and see a test go red: ``python -m tests.mutations``.

Each mutation is one replacement in one file of a copy of the repository. The tests named with it
must fail there; a mutation that survives, or whose text is no longer in the code, fails the run.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PARTS = ("earth", "align", "navgrade", "tests", "pyproject.toml")
NED = "navgrade/mechanization/ned.py"
CAUSAL = "navgrade/reconstruction/causal.py"
HOUR = "tests/navgrade/test_accuracy.py"
LAWS = "tests/navgrade/test_laws.py"
BODY = "tests/navgrade/test_reconstruction.py"


@dataclass(frozen=True)
class Mutation:
    """One deliberate fault and the tests that must see it."""

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]


MUTATIONS = (
    Mutation(
        "Earth rate 1 % off",
        "earth/rates.py",
        "return params.omega * cos_lat, -params.omega * sin_lat",
        "return 1.01 * params.omega * cos_lat, -1.01 * params.omega * sin_lat",
        (HOUR,),
    ),
    Mutation(
        "Coriolis sign",
        NED,
        "(g_n - coriolis[0], -coriolis[1], g_d - coriolis[2])",
        "(g_n + coriolis[0], coriolis[1], g_d + coriolis[2])",
        (LAWS, HOUR),
    ),
    Mutation(
        "coning term deleted",
        CAUSAL,
        "phi[row, i] = theta[i] + coning[i]",
        "phi[row, i] = theta[i]",
        (BODY, HOUR),
    ),
    Mutation(
        "sculling term deleted",
        CAUSAL,
        " + sculling_v[i] + sculling_theta[i]",
        "",
        (BODY, HOUR),
    ),
    Mutation(
        "rotation term halved to theta x v / 2",
        CAUSAL,
        "v[i] + r1 * turn[i] + r2 * turn2[i]",
        "v[i] + 0.5 * turn[i]",
        (BODY, HOUR),
    ),
    Mutation(
        "north gravity dropped",
        "earth/gravity.py",
        "return north * sin_lat * cos_lat * h, down",
        "return 0.0 * north, down",
        (HOUR,),
    ),
    Mutation(
        "half of sculling deleted",
        CAUSAL,
        " + sculling_theta[i]",
        "",
        (BODY,),
    ),
    Mutation(
        "transport rate sign",
        "earth/rates.py",
        "return north, -v_n * per_meridian, -north * tan_lat",
        "return north, v_n * per_meridian, -north * tan_lat",
        (HOUR,),
    ),
    Mutation(
        "radii exchanged",
        "earth/geodetic.py",
        "return transverse * (1.0 - params.e2) * w2, transverse",
        "return transverse, transverse * (1.0 - params.e2) * w2",
        (HOUR,),
    ),
    Mutation(
        "frame rotation of the velocity increment dropped",
        NED,
        "(f[1] - half * turn[1])",
        "f[1]",
        (HOUR,),
    ),
    Mutation(
        "uneven intervals taken as even",
        CAUSAL,
        "if abs(dt[k - m] - dt[k]) > _EQUAL * dt[k]:",
        "if False:",
        (BODY,),
    ),
    Mutation(
        "position summed without compensation",
        NED,
        "return new, (new - total) - y",
        "return new, 0.0 * y",
        (LAWS,),
    ),
)


def is_red(mutation: Mutation, folder: Path) -> bool:
    """Apply a mutation to a copy of the repository and return whether its tests fail."""
    for part in PARTS:
        source = ROOT / part
        if source.is_dir():
            ignore = shutil.ignore_patterns("__pycache__", "node_modules")
            shutil.copytree(source, folder / part, ignore=ignore)
        else:
            shutil.copy(source, folder / part)
    target = folder / mutation.file
    text = target.read_text()
    if text.count(mutation.old) != 1:
        raise SystemExit(f"{mutation.name}: its text stands {text.count(mutation.old)} times")
    target.write_text(text.replace(mutation.old, mutation.new))
    environment = {
        **os.environ,
        "PYTHONPATH": str(folder),
        "NUMBA_CACHE_DIR": str(folder / "cache"),
    }
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
    done = subprocess.run(
        [*command, *mutation.tests], cwd=folder, env=environment, capture_output=True, text=True
    )
    if done.returncode not in (0, 1):  # 1: tests ran and failed
        raise SystemExit(f"{mutation.name}: pytest ended with {done.returncode}\n{done.stdout}")
    return done.returncode == 1


def main() -> None:
    """Try all mutations and report."""
    untouched = Mutation("no mutation", NED, "class Ned:", "class Ned:", (BODY, LAWS, HOUR))
    with tempfile.TemporaryDirectory() as folder:
        if is_red(untouched, Path(folder)):
            raise SystemExit("the tests fail without any mutation")
    survived = []
    for mutation in MUTATIONS:
        with tempfile.TemporaryDirectory() as folder:
            caught = is_red(mutation, Path(folder))
        print(f"{'red' if caught else 'SURVIVED':<9}{mutation.name}", flush=True)
        if not caught:
            survived.append(mutation.name)
    if survived:
        raise SystemExit(f"{len(survived)} of {len(MUTATIONS)} mutations survived")
    print(f"all {len(MUTATIONS)} mutations turned a test red")


if __name__ == "__main__":
    main()
