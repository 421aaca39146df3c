"""A sensor sheet, line by line."""

from __future__ import annotations

import math

import numpy as np
import pytest

from navgrade.sensors import SHEET, imu_errors

DEG = math.pi / 180.0  # rad
UG = 9.80665e-6  # m/s^2


def test_units() -> None:
    errors = imu_errors(
        {
            "gyro_bias_deg_h": [1.0, -2.0, 3.0],
            "gyro_scale_ppm": 250.0,
            "gyro_misalignment_mrad": [1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
            "arw_deg_rth": 0.6,
            "gyro_walk_deg_h_rth": 6.0,
            "gyro_markov_deg_h": 7.0,
            "gyro_markov_time_s": 300.0,
            "gyro_quantum_arcsec": 3.6,
            "gyro_resolution_deg_s": 0.5,
            "accel_bias_ug": 100.0,
            "accel_misalignment_sigma_mrad": 0.2,
            "vrw_ug_rthz": 50.0,
            "accel_walk_ug_rth": 60.0,
            "accel_quantum_um_s": 5.0,
            "accel_resolution_ug": 500.0,
        }
    )
    g, a = errors.gyro, errors.accel
    np.testing.assert_allclose(g.bias, np.array([1.0, -2.0, 3.0]) * DEG / 3600.0, rtol=1e-15)
    np.testing.assert_allclose(g.scale, [250e-6] * 3, rtol=1e-15)
    expected = np.array([[0.0, 1.0, 2.0], [3.0, 0.0, 4.0], [5.0, 6.0, 0.0]]) * 1e-3
    np.testing.assert_allclose(g.misalignment, expected, rtol=1e-15)
    assert g.white == pytest.approx(0.6 * DEG / 60.0, rel=1e-15)
    assert g.walk == pytest.approx(6.0 * DEG / 3600.0 / 60.0, rel=1e-15)
    assert (g.markov, g.markov_time) == (pytest.approx(7.0 * DEG / 3600.0, rel=1e-15), 300.0)
    assert g.quantum == pytest.approx(1e-3 * DEG, rel=1e-15)
    assert g.resolution == pytest.approx(0.5 * DEG, rel=1e-15)
    np.testing.assert_allclose(a.bias, [100.0 * UG] * 3, rtol=1e-15)
    assert a.misalignment_sigma == pytest.approx(2e-4, rel=1e-15)
    assert a.white == pytest.approx(50.0 * UG, rel=1e-15)
    assert a.walk == pytest.approx(UG, rel=1e-15)
    assert a.quantum == pytest.approx(5e-6, rel=1e-15)
    assert a.resolution == pytest.approx(500.0 * UG, rel=1e-15)


def test_wrong_lines() -> None:
    with pytest.raises(ValueError, match="'arw' is not one of"):
        imu_errors({"arw": 1.0})
    with pytest.raises(ValueError, match=r"gyro_misalignment_mrad must be 6 numbers, got \[1.0\]"):
        imu_errors({"gyro_misalignment_mrad": [1.0]})
    with pytest.raises(ValueError, match="arw_deg_rth must be one number"):
        imu_errors({"arw_deg_rth": [1.0, 2.0, 3.0]})


def test_the_unit_stands_in_the_name() -> None:
    for key, entry in SHEET.items():
        assert key.rsplit("_", 1)[-1] in ("h", "ppm", "mrad", "rth", "s", "arcsec", "ug", "rthz")
        assert entry.part in ("gyro", "accel")
