"""The page of message types says what the registry says."""

from __future__ import annotations

from pathlib import Path

from benchmarks.schemas import page
from navgrade.logs.schemas import AIDING_SCHEMAS, HEIGHT_SCHEMAS, IMU_SCHEMAS


def test_the_page_is_that_of_the_registry() -> None:
    """`python -m benchmarks schemas --write` makes it."""
    written = Path(__file__).resolve().parents[3] / "docs" / "schemas.md"
    assert written.read_text() == page()


def test_every_entry_has_its_line_and_its_traps() -> None:
    lines = page().splitlines()
    for schema in (*IMU_SCHEMAS, *AIDING_SCHEMAS):
        assert any(line.startswith(f"| `{schema.name}`") for line in lines)
        for trap in schema.traps:
            assert f"- {trap}" in lines
    for name in HEIGHT_SCHEMAS:
        assert any(line.startswith(f"| `{name}`") for line in lines)
