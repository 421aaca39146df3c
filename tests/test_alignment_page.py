"""What docs/alignment.md shows is what happens."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from align import METHODS
from navgrade.site import read_site

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "alignment.md").read_text()
MARKS = ROOT / "tests" / "align" / "marks" / "surveyor.csv"
AT_A_MARK = '[site]\nmarks = "marks.csv"\nmark = "PIER 1"\n'


def test_the_example_prints_what_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    ((example, shown),) = re.findall(r"```python\n(.*?)```\n\nprints\n\n```\n(.*?)```", PAGE, re.S)
    exec(example, {})
    assert capsys.readouterr().out == shown


@pytest.mark.parametrize("block", re.findall(r"```toml\n(.*?)```", PAGE, re.S))
def test_the_site_files_shown_are_read(block: str, tmp_path: Path) -> None:
    (tmp_path / "marks.csv").write_bytes(MARKS.read_bytes())
    text = block.replace('datum = "ITRF2014"', "#")  # the marks name their own
    if "[site]" not in text or "heading_deg" in text:
        text = AT_A_MARK + text.replace("[site]\n", "")
    path = tmp_path / "site.toml"
    path.write_text(text)
    place = read_site(path).place
    assert place is not None
    assert (place.heading is not None) == ("heading" in text or "[azimuth]" in text)


def test_every_method_is_explained() -> None:
    for name in METHODS:
        assert f"`{name}`" in PAGE, name


def test_every_picture_is_there_and_every_table_filled() -> None:
    pictures = re.findall(r"!\[.*?\]\((.*?)\)", PAGE)
    assert len(pictures) == 4
    assert all((ROOT / "docs" / name).is_file() for name in pictures)
    tables = re.findall(r"<!-- ([a-z-]+) -->\n(.*?)<!-- end of \1 -->", PAGE, re.S)
    assert len(tables) == 13
    assert all("|---" in lines for _, lines in tables)
