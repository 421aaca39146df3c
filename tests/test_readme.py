"""What README shows is what happens."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from navgrade.cli import main
from navgrade.site import read_site

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text()


def block(language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", README, re.DOTALL)
    assert found is not None
    return found[1]


def test_python_example(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data").symlink_to(ROOT / "data")
    exec(compile(block("python"), "README.md", "exec"), {})
    assert (tmp_path / "nav.mcap").stat().st_size > 100_000


def test_site_file_example(tmp_path: Path) -> None:
    path = tmp_path / "site.toml"
    path.write_text(block("toml"))
    site = read_site(path)
    assert site.axes == "RFU"
    assert site.place is not None
    assert site.place.h == 1118.5


def test_tour(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Every line of the tour's output is printed."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data").symlink_to(ROOT / "data")
    tour = re.search(r"```\n\$ navgrade (run .*?)\n(.*?)```", README, re.DOTALL)
    assert tour is not None
    with pytest.raises(SystemExit):
        main(tour[1].split())
    printed = capsys.readouterr().out
    missing = [line for line in tour[2].splitlines() if line and line not in printed]
    assert not missing


def test_simulate_run_compare(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The three commands in a row print what is shown; so they do along the drawn path."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data").symlink_to(ROOT / "data")
    shown = re.search(r"```\n(\$ navgrade simulate .*?)```", README, re.DOTALL)
    assert shown is not None
    calls = [line for line in shown[1].splitlines() if line.startswith("$")]
    assert len(calls) == 3
    for call in (*calls, *(call.replace("car", "path") for call in calls)):
        with pytest.raises(SystemExit) as stop:
            main(call.split()[2:])
        assert stop.value.code == 0, call
        printed = capsys.readouterr().out
        if call == calls[-1]:
            missing = [line for line in shown[1].splitlines()[3:] if line not in printed]
            assert not missing
    assert (tmp_path / "car.html").stat().st_size > 1_000_000
    assert (tmp_path / "path.html").stat().st_size > 1_000_000
