"""Pictures hold curves."""

from __future__ import annotations

from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from PIL import Image

from navgrade.errors import ConfigError
from navgrade.report import write_pictures
from tests.navgrade.report.comparisons import comparison


def hues(pixels: np.ndarray) -> int:
    """How many of 36 hues cover at least 60 saturated pixels each."""
    red, green, blue = pixels[..., 0], pixels[..., 1], pixels[..., 2]
    colored = np.ptp(pixels, axis=-1) > 0.3
    hue = np.arctan2(np.sqrt(3.0) * (green - blue), 2.0 * red - green - blue)[colored]
    counts, _ = np.histogram(hue, bins=36, range=(-np.pi, np.pi))
    return int((counts > 60).sum())


def test_pictures_for_papers(tmp_path: Path) -> None:
    paths = write_pictures(comparison(), tmp_path)
    assert [path.name for path in paths] == ["track.png", "growth.png", "terms.png"]
    for path in paths:
        pixels = matplotlib.image.imread(path)[..., :3]
        assert pixels.shape[1] == 1050  # a column of 3.5 in at 300 dpi
        assert 900 < pixels.shape[0] < 1600
        with Image.open(path) as image:
            assert image.info["dpi"] == pytest.approx((300.0, 300.0), abs=0.1)
        inked = (pixels < 0.8).any(axis=-1)
        assert 0.02 < inked.mean() < 0.5
        assert hues(pixels) >= 5
        # nothing is cut off at the edges
        frame = np.concatenate([inked[:2].ravel(), inked[-2:].ravel(), inked[:, :2].ravel()])
        assert not frame.any()
    assert sorted(tmp_path.iterdir()) == sorted(paths)
    with pytest.raises(ConfigError, match="exists"):
        write_pictures(comparison(), tmp_path)
