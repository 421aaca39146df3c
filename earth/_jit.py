"""The one place that knows numba.

Three decorators serve the whole project:

``formula``
    A plain Python function over scalars. Called from Python it is just that (and, being built
    from NumPy functions, it broadcasts over arrays); called inside a kernel it is compiled into
    the kernel. One formula, one place, for the interface and for the hot loops.
``rare_formula``
    The same for a long formula that loops seldom reach.
``kernel``
    A compiled loop, cached on disk.

numba's disk cache does not notice that a function in *another* file changed: the cached loop
silently keeps the old formula. The cache folder is therefore keyed by a hash of every source
file that defines kernels or formulas.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba import config
from numba.extending import register_jitable
from platformdirs import user_cache_path

F = TypeVar("F", bound=Callable[..., Any])

_config: Any = config  # its settings are made at run time, no checker sees them
_SOURCES = Path(__file__).resolve().parents[1]
_PACKAGES = ("earth", "align", "navgrade")  # they share kernels, hence one key
# Of the fast-math liberties only fused multiply-add: it rounds once instead of twice, never
# reorders, and so leaves compensated sums intact. docs/decisions/0002 has the numbers.
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract"}}


def _sources_key(root: Path) -> str:
    digest = hashlib.sha256()
    for package in _PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            text = path.read_bytes()
            if b"_jit" in text:
                digest.update(path.relative_to(root).as_posix().encode() + b"\0" + text)
    return digest.hexdigest()[:16]


def _cache_folder() -> str | None:
    """Folder of this source tree's compiled code; None where no folder can be written."""
    base = Path(_config.CACHE_DIR) if _config.CACHE_DIR else user_cache_path("navgrade")
    folder = base / "kernels" / _sources_key(_SOURCES)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return str(folder) if os.access(folder, os.W_OK) else None


CACHE_FOLDER = _cache_folder()


def formula(func: F) -> F:
    """Mark a scalar formula: plain Python outside kernels, part of the machine code inside."""
    marked: F = register_jitable(**_OPTIONS, forceinline=True)(func)
    return marked


def rare_formula(func: F) -> F:
    """Mark a long formula off the hot path: as `formula`, but called, not merged into the loop."""
    marked: F = register_jitable(**_OPTIONS)(func)
    return marked


def kernel(func: F) -> F:
    """Compile a loop, cached on disk under a key of all kernel sources; threads may share it."""
    if CACHE_FOLDER is None:
        uncached: F = numba.njit(nogil=True, **_OPTIONS)(func)
        return uncached
    previous, _config.CACHE_DIR = _config.CACHE_DIR, CACHE_FOLDER
    try:
        compiled: F = numba.njit(cache=True, nogil=True, **_OPTIONS)(func)
    finally:
        _config.CACHE_DIR = previous
    return compiled
