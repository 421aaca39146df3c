"""Pages, pictures and tables of results."""

from __future__ import annotations

from typing import TYPE_CHECKING

from earth._lazy import lazy

if TYPE_CHECKING:
    from navgrade.report.alignment import write_alignment_page
    from navgrade.report.page import write_page
    from navgrade.report.picture import write_pictures
    from navgrade.report.table import as_dict, write_tables

_HOMES = {
    "as_dict": "navgrade.report.table",
    "write_alignment_page": "navgrade.report.alignment",
    "write_page": "navgrade.report.page",
    "write_pictures": "navgrade.report.picture",
    "write_tables": "navgrade.report.table",
}

__all__ = ["as_dict", "write_alignment_page", "write_page", "write_pictures", "write_tables"]

__getattr__ = lazy(__name__, _HOMES)


def __dir__() -> list[str]:
    return sorted(__all__)
