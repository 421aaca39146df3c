"""WGS-84 defining constants (NGA.STND.0036, EPSG:7030), as decimal text and as float64.

The text feeds the 50-digit routes, so that no float64 rounding enters them.
"""

EQUATORIAL_RADIUS_TEXT = "6378137"  # equatorial radius, m
INVERSE_FLATTENING_TEXT = "298.257223563"
GM_TEXT = "3.986004418e14"  # m^3/s^2
OMEGA_TEXT = "7.292115e-5"  # rad/s

EQUATORIAL_RADIUS = float(EQUATORIAL_RADIUS_TEXT)  # m
GM = float(GM_TEXT)  # m^3/s^2
OMEGA = float(OMEGA_TEXT)  # rad/s
E2 = 0.006694379990141317  # first eccentricity squared, f (2 - f)
J2 = 1.082629821313306e-3  # of the normal field, so that the ellipsoid is its level surface
