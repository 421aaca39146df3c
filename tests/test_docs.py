"""What docs/logs.md shows is what happens."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.navgrade.cli.calling import navgrade
from tests.navgrade.cli.test_inspect import REPORT, STAMPS, TOPIC

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "logs.md").read_text()


def test_every_command_shown_prints_what_is_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data").symlink_to(ROOT / "data")
    blocks = re.findall(r"```\n(\$ .*?)```", PAGE, re.DOTALL)
    calls = [call for block in blocks for call in block.split("$ navgrade ")[1:]]
    assert len(calls) == 5
    for call in calls:
        command, _, shown = call.replace("\\\n", " ").partition("\n")
        outcome = navgrade(*command.split())
        assert (outcome.code, outcome.err) == (0, ""), command
        printed = [line.rstrip() for line in outcome.out.splitlines()]
        assert printed == shown.splitlines()


def test_every_key_of_the_json_is_named() -> None:
    for key in REPORT | TOPIC | STAMPS:
        assert f"`{key}`" in PAGE, key
