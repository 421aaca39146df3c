"""Factors that carry a number into SI: ``bias = 0.01 * DEG_PER_H``.

Divide by the same factor to leave SI. Nothing inside the packages uses any other unit.
"""

from math import pi

DEG = pi / 180.0  # rad
ARCMIN = DEG / 60.0  # rad
ARCSEC = DEG / 3600.0  # rad
HOUR = 3600.0  # s
DEG_PER_S = DEG  # rad/s
DEG_PER_H = DEG / HOUR  # rad/s
DEG_PER_RTH = DEG / 60.0  # rad/sqrt(s): angle random walk, 1 deg/sqrt(h)
STANDARD_GRAVITY = 9.80665  # m/s^2, exact by definition (3rd CGPM, 1901)
UG = 1e-6 * STANDARD_GRAVITY  # m/s^2
MG = 1e-3 * STANDARD_GRAVITY  # m/s^2
UG_PER_RTHZ = UG  # (m/s^2)/sqrt(Hz), equal to (m/s)/sqrt(s): velocity random walk
MGAL = 1e-5  # m/s^2
NMI = 1852.0  # m
KMH = 1.0 / 3.6  # m/s
