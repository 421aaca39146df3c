"""The one place that knows numba.

Three decorators serve the whole project, and two functions a user's own formulas:

``formula``
    A plain Python function over scalars. Called from Python it is just that (and, being built
    from NumPy functions, it broadcasts over arrays); called inside a kernel it is compiled into
    the kernel. One formula, one place, for the interface and for the hot loops.
``rare_formula``
    The same for a long formula that loops seldom reach.
``kernel``
    A compiled loop, cached on disk.
``compiled``, ``uncached``
    A user's formula, and a loop that takes it as an argument; neither is kept on disk.

numba's disk cache does not notice that a function in *another* file changed: the cached loop
silently keeps the old formula. The cache folder is therefore keyed by a hash of every source
file that defines kernels or formulas.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba import config, types
from numba.core.errors import NumbaError, UnsupportedBytecodeError
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
        loop: F = numba.njit(nogil=True, **_OPTIONS)(func)
        return loop
    previous, _config.CACHE_DIR = _config.CACHE_DIR, CACHE_FOLDER
    try:
        loop = numba.njit(cache=True, nogil=True, **_OPTIONS)(func)
    finally:
        _config.CACHE_DIR = previous
    return loop


@cache
def _twin(loop: Any) -> Any:
    return numba.njit(nogil=True, **_OPTIONS)(loop.py_func)


def uncached(loop: F) -> F:
    """Return the twin of a kernel that is never kept on disk, the same one every time.

    A kernel that takes a user's compiled function as an argument is only good for that function
    object, which ends with the process: on disk it would never be found again.
    """
    twin: F = _twin(loop)
    return twin


@cache
def compiled(func: Callable[..., Any], returns: str) -> Callable[..., Any]:
    """Compile a user's function of three floats that returns a tuple of three, for kernels.

    Parameters
    ----------
    func : callable
        A plain function, or one compiled by numba already. Globals and closures keep the value
        they have now.
    returns : str
        The three results, for the message: ``"(g_n, g_e, g_d)"``.

    Raises
    ------
    TypeError
        If `func` is not a function, numba cannot compile it, or it returns something else.
    """
    name = getattr(func, "__name__", None) or repr(func)
    signature = (types.float64,) * 3
    try:
        done: Any = func if hasattr(func, "py_func") else numba.njit(**_OPTIONS)(func)
        done.compile(signature)
    except (NumbaError, UnsupportedBytecodeError, TypeError, AttributeError) as error:
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
        cause = next((line for line in lines if not line.startswith("Failed in nopython")), "")
        raise TypeError(
            f"numba cannot compile {name}(lat, lon, h), which must be a plain function of three "
            f"floats whose every call is to NumPy, math or numba-compiled functions: {cause}"
        ) from error
    found = done.overloads[signature].signature.return_type
    parts = getattr(found, "types", ())
    if len(parts) != 3 or not all(isinstance(x, types.Integer | types.Float) for x in parts):
        raise TypeError(
            f"{name}(lat, lon, h) must return the tuple of three floats {returns}; it returns "
            f"{found}"
        )
    function: Callable[..., Any] = done
    return function
