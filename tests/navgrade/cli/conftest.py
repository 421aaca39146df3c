"""A bench for every test of the command line."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.navgrade.cli.calling import Bench


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    """An empty bench."""
    return Bench(tmp_path)
