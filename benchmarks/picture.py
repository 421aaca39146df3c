"""Draw the README's picture from the sample: ``python -m benchmarks.picture SOLUTION.mcap``."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from tests.sample import compare

ROOT = Path(__file__).resolve().parents[1]


def main() -> None:
    """Write docs/sample.png."""
    solution = Path(sys.argv[1])
    c = compare(solution, ROOT / "data" / "sample_truth.csv")
    figure, (plan, growth) = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
    plan.plot(c.truth_east, c.truth_north, color="0.75", linewidth=5, label="truth")
    plan.plot(c.truth_east + c.east, c.truth_north + c.north, color="C0", label="navgrade")
    plan.set(xlabel="east, m", ylabel="north, m", aspect="equal", title="sample drive, 180 s")
    plan.legend(frameon=False)
    t = c.t - c.t[0]
    growth.plot(t, np.hypot(c.north, c.east), label="horizontal")
    growth.plot(t, np.abs(c.up), label="vertical")
    growth.set(xlabel="s since alignment", ylabel="error, m", title="free inertial, unaided")
    growth.legend(frameon=False)
    growth.grid(alpha=0.3)
    figure.savefig(ROOT / "docs" / "sample.png", dpi=110)


if __name__ == "__main__":
    main()
