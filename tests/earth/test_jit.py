"""The compiled-code cache: a changed formula is never answered with yesterday's machine code."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from earth import _jit

REPOSITORY = Path(_jit.__file__).resolve().parents[1]


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    """A copy of everything that may define kernels."""
    for package in ("earth", "align", "navgrade"):
        shutil.copytree(
            REPOSITORY / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__")
        )
    return tmp_path


def test_the_key_depends_on_the_sources_alone(sources: Path) -> None:
    key = _jit._sources_key(sources)
    assert re.fullmatch(r"[0-9a-f]{16}", key)
    assert key == _jit._sources_key(REPOSITORY)
    for path in sources.rglob("*.py"):
        os.utime(path, (0, 0))
    (sources / "earth" / "notes.txt").write_text("from earth._jit import kernel")
    assert _jit._sources_key(sources) == key


@pytest.mark.parametrize(
    "name",
    [
        "earth/gravity.py",
        "earth/rotation.py",
        "earth/rates.py",
        "earth/geodetic.py",
        "earth/_jit.py",
    ],
)
def test_the_key_changes_with_any_kernel_source(sources: Path, name: str) -> None:
    key = _jit._sources_key(sources)
    path = sources / name
    text = path.read_text()
    path.write_text(text.replace("0.5", "0.6", 1) if "0.5" in text else text + "\n")
    changed = _jit._sources_key(sources)
    assert changed != key
    path.write_text(text)
    assert _jit._sources_key(sources) == key


@pytest.mark.parametrize("package", ["earth", "align", "navgrade"])
def test_the_key_notices_a_new_a_moved_and_a_lost_file(sources: Path, package: str) -> None:
    keys = [_jit._sources_key(sources)]
    new = sources / package / "deep" / "new.py"
    new.parent.mkdir()
    new.write_text("from earth._jit import formula\n")
    keys.append(_jit._sources_key(sources))
    new.rename(new.with_name("moved.py"))
    keys.append(_jit._sources_key(sources))
    assert len(set(keys)) == 3
    new.with_name("moved.py").unlink()
    assert _jit._sources_key(sources) == keys[0]


def test_the_folder_carries_the_key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_jit._config, "CACHE_DIR", str(tmp_path))
    folder = _jit._cache_folder()
    assert folder is not None
    assert Path(folder).is_dir()
    assert tmp_path in Path(folder).parents
    assert Path(folder).name == _jit._sources_key(REPOSITORY)


def test_without_a_folder_kernels_still_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken = tmp_path / "file"
    taken.write_text("not a folder")
    monkeypatch.setattr(_jit._config, "CACHE_DIR", str(taken))
    assert _jit._cache_folder() is None
    monkeypatch.setattr(_jit, "CACHE_FOLDER", None)

    def halves(values, out):
        for i in range(values.size):
            out[i] = values[i] / 2.0

    out = np.empty(3)
    _jit.kernel(halves)(np.array([1.0, -4.0, 0.5]), out)
    np.testing.assert_array_equal(out, [0.5, -2.0, 0.25])


@_jit.kernel
def _apply(function, values, out):
    for i in range(values.size):
        out[i] = function(values[i], 2.0, 3.0)[2]


@pytest.mark.skipif(_jit.CACHE_FOLDER is None, reason="no folder for compiled code")
def test_an_uncached_twin_leaves_the_disk_alone() -> None:
    twin = _jit.uncached(_apply)
    assert twin is _jit.uncached(_apply)
    assert twin is not _apply
    out = np.empty(2)
    for factor in (2.0, -3.0):

        def scaled(x, y, z):
            return x, y, factor * x * y * z  # noqa: B023  # compiled at once, so bound now

        twin(_jit.compiled(scaled, "(a, b, c)"), np.array([1.0, 0.5]), out)
        np.testing.assert_array_equal(out, [6.0 * factor, 3.0 * factor])
    for dispatcher, kept in ((_apply, True), (twin, False)):
        assert (dispatcher.stats.cache_path is not None) is kept  # type: ignore[attr-defined]
    assert not any(Path(_apply.stats.cache_path).glob("*_apply*"))  # type: ignore[attr-defined]


def test_a_function_is_compiled_once() -> None:
    def simple(a, b, c):
        return a, b, c

    done = _jit.compiled(simple, "(a, b, c)")
    assert _jit.compiled(simple, "(a, b, c)") is done
    assert done(1.0, 2.0, 3.0) == (1.0, 2.0, 3.0)
    assert _jit.compiled(done, "(a, b, c)") is done  # numba's own are taken as they are


def _not_compiled(x):
    return x


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda a, b: (a, b, a), "numba cannot compile <lambda>.*Signature mismatch"),
        (lambda a, b, c: (_not_compiled(a), b, c), "Untyped global name '_not_compiled'"),
        (lambda a, b, c: (a, b, unknown), "name 'unknown' is not defined"),  # noqa: F821
        (lambda a, b, c: c, r"must return the tuple of three floats \(x, y, z\).*float64"),
        (lambda a, b, c: (a, b), "must return the tuple of three floats.*float64 x 2"),
        (lambda a, b, c: [a, b, c], "must return the tuple of three floats.*list"),
        (lambda a, b, c: (a, b, "c"), "must return the tuple of three floats"),
        (lambda a, b, c: np.array([a, b, c]), "must return the tuple of three floats.*array"),
        (lambda a, b, c: (a, b, 1j * c), "must return the tuple of three floats.*complex"),
        (np.add, "numba cannot compile add.*not a function"),
        ("text", "numba cannot compile 'text'.*not a function"),
    ],
)
def test_what_cannot_be_used_in_a_loop_is_refused_in_one_line(
    function: Callable[..., object], message: str
) -> None:
    with pytest.raises(TypeError, match=message) as caught:
        _jit.compiled(function, "(x, y, z)")
    assert "\n" not in str(caught.value)


def test_kernels_divide_like_numpy() -> None:
    """No exception leaves a kernel: a division by zero is infinite, as in an array."""

    def reciprocal(values, out):
        for i in range(values.size):
            out[i] = 1.0 / values[i]

    out = np.empty(2)
    _jit.kernel(reciprocal)(np.array([0.0, -0.0]), out)
    np.testing.assert_array_equal(out, [np.inf, -np.inf])


FORMULA = """
from earth._jit import formula

@formula
def scaled(x):
    return {factor} * x
"""
RARE_FORMULA = FORMULA.replace("formula", "rare_formula")
LOOP = """
from earth._jit import kernel
from earth.probe_formula import scaled

@kernel
def loop(values, out):
    for i in range(values.size):
        out[i] = scaled(values[i])
"""
SCRIPT = """
import numpy as np
import earth
from earth.probe_loop import loop

values, out = np.array([1.0, -2.5]), np.empty(2)
loop(values, out)
hits = sum(loop.stats.cache_hits.values())
print(earth.__file__, out[0], out[1], hits, sep="|")
"""


def run_probe(root: Path) -> tuple[list[float], int]:
    """Import the copied package in a fresh process; what its loop returns, and cache hits."""
    environment = {
        **os.environ,
        "NUMBA_CACHE_DIR": str(root / "cache"),
        "PYTHONPATH": str(root),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    done = subprocess.run(
        [sys.executable, str(root / "probe.py")],
        env=environment,
        cwd=root,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    home, first, second, hits = done.stdout.strip().split("|")
    assert Path(home).is_relative_to(root), "the copy is not what was imported"
    return [float(first), float(second)], int(hits)


@pytest.mark.parametrize("formula", [FORMULA, RARE_FORMULA], ids=["formula", "rare_formula"])
def test_a_changed_formula_in_another_file_reaches_the_cached_loop(
    sources: Path, formula: str
) -> None:
    (sources / "earth" / "probe_loop.py").write_text(LOOP)
    (sources / "probe.py").write_text(SCRIPT)
    changing = sources / "earth" / "probe_formula.py"
    changing.write_text(formula.format(factor="2.0"))
    assert run_probe(sources) == ([2.0, -5.0], 0)
    assert run_probe(sources) == ([2.0, -5.0], 1)  # the cache is in use
    changing.write_text(formula.format(factor="3.0"))
    assert run_probe(sources) == ([3.0, -7.5], 0)
