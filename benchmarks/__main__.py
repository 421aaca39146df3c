"""Measure what the documentation claims: ``python -m benchmarks [WHAT]``, see ``--help``."""

from __future__ import annotations

import argparse
import importlib.util
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1] / "docs"

_HEAD = """\
# Accuracy

Each line is a claim, where it holds, what was measured, the limit its test enforces, and the test.
`python -m benchmarks accuracy --write` measures and writes this page.

Truth is in closed form (`tests/oracles`): position and Euler angles as sums of sinusoids,
derivatives exact, increments by Gauss quadrature, normal gravity by zonal harmonics. It shares
neither code nor constants with the engine and is itself checked against 50-digit arithmetic.
Errors are the largest at any instant, not the last.

"""

_COMPARISON = """
## Every reconstruction, and a peer

Largest horizontal / vertical error of the same hour-long cases in frame n, ten rows a second
looked at. pyins (`python-ins`) gets truth made with its own gravity model, so its row, too, is
integration error alone. Block forms are the literature's; four samples are worse than two in
manoeuvres.

"""

_CONING = """
## Coning, sculling, SPIN-CONE

Measured / theory where a closed form exists: what an algorithm leaves of pure coning
(docs/equations.md, section 2), of sculling by duality, and the final attitude of Savage's
SPIN-CONE. Tests: `tests/navgrade/test_coning.py`.

"""

_LIMITS = """
## Where this stops being true

- Exact increments of band-limited motion. What a sensor adds (bias, noise, bandwidth, quantisation)
  comes on top, and with real sensors it is larger by orders of magnitude.
- Vibration above a tenth of the sample rate: the error grows with a high power of frequency (the
  coning table), and nothing recovers what lies beyond half the sample rate.
- Frame n: latitudes to ±89.9°. Frames e, i and w: everywhere.
- Heights from -1 to 20 km run on the gravity fit; outside, on the closed form, more slowly.
- Normal gravity is the ellipsoid's. The real field departs from it, and no integration removes
  that.
"""


def accuracy(write: bool) -> None:
    """Print the accuracy page, or write it to docs."""
    from benchmarks.accuracy import comparison, earth_rows, hour_rows, real_rows
    from benchmarks.coning import coning_table

    lines = ["| claim | domain | measured | limit | test |", "|---|---|---|---|---|"]
    for rows in (hour_rows(), earth_rows(), real_rows()):
        lines += [f"| {r.claim} | {r.domain} | {r.value} | {r.limit} | `{r.test}` |" for r in rows]
    peer = importlib.util.find_spec("pyins") is not None
    text = _HEAD + "\n".join(lines) + "\n" + _COMPARISON + "\n".join(comparison(peer)) + "\n"
    text += _CONING + "\n".join(coning_table()) + "\n" + _LIMITS
    if write:
        (DOCS / "accuracy.md").write_text(text)
    print(text)


def speed() -> None:
    """Print the engine's speed, and start-up."""
    from benchmarks.c_loop import c_ratio
    from benchmarks.speed import kernel_ratio, long_log, startup

    if importlib.util.find_spec("pyins") is None:
        print('pyins is not installed (pip install ".[bench]"): no ratio')
    else:
        print("\n".join(kernel_ratio()))
    print("\n".join(c_ratio()))
    print("\n".join(long_log()))
    print("\n".join(startup()))


def mcap(write: bool, messages: int, rounds: int, long: bool) -> None:
    """Print the performance page as it is measured, and write it to docs."""
    from benchmarks.mcap_speed import report

    text = ""
    for section in report(messages, rounds=rounds, long=long):
        print(section, end="", flush=True)
        text += section
    if write:
        (DOCS / "performance.md").write_text(text)


def schemas(write: bool) -> None:
    """Print the page of message types, or write it to docs."""
    from benchmarks.schemas import page

    if write:
        (DOCS / "schemas.md").write_text(page())
    print(page())


def lectures(write: bool) -> None:
    """Print the page of the flat world, its tables measured afresh, or write it to docs."""
    from benchmarks.lectures import PAGE, page

    text = page()
    if write:
        PAGE.write_text(text)
    print(text)


def scenarios(write: bool) -> None:
    """Print how the ready scenarios close, or write it, and their pictures, to docs."""
    from benchmarks.scenarios import ORDER, closings, draw, errors, filled, grades

    lines = []
    for line in closings():
        print(line, flush=True)
        lines.append(line)
    if write:
        path = DOCS / "scenarios.md"
        tables = {"closing": iter(lines), "errors": errors(), "grades": grades()}
        path.write_text(filled(path.read_text(), tables))
        for name in ORDER:
            draw(name)


def main() -> None:
    """Run the benchmarks named on the command line, all of them by default."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    choices = (
        "accuracy",
        "speed",
        "solvers",
        "mcap",
        "schemas",
        "lectures",
        "scenarios",
        "studies",
        "alignment",
        "all",
    )
    parser.add_argument("what", nargs="?", choices=choices, default="all")
    parser.add_argument(
        "--write",
        action="store_true",
        help="write docs/accuracy.md, performance.md, schemas.md, flat-world.md, scenarios.md and "
        "alignment.md, these two with their pictures",
    )
    logs = parser.add_argument_group("mcap")
    logs.add_argument("--messages", type=int, default=2_000_000, metavar="N", help="at least 5000")
    logs.add_argument("--quick", action="store_true", help="one round instead of five")
    logs.add_argument("--long", action="store_true", help="navigate ten hours as well as one")
    options = parser.parse_args()
    if options.what in ("accuracy", "all"):
        accuracy(options.write)
    if options.what in ("speed", "all"):
        speed()
    if options.what in ("solvers", "all"):
        from benchmarks.picard import picard_table

        print("\n".join(picard_table()))
    if options.what in ("mcap", "all"):
        mcap(options.write, options.messages, 1 if options.quick else 5, options.long)
    if options.what in ("schemas", "all"):
        schemas(options.write)
    if options.what in ("lectures", "all"):
        lectures(options.write)
    if options.what in ("scenarios", "all"):
        scenarios(options.write)
    if options.what in ("studies", "all"):
        from benchmarks.studies import study_rows

        for row in study_rows():
            print(row, flush=True)
    if options.what in ("alignment", "all"):
        from benchmarks.alignment import measure

        measure(options.write)
        if options.write:
            from benchmarks.alignment_pictures import draw

            draw()


if __name__ == "__main__":
    main()
