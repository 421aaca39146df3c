"""Deflections and disturbances: signs by physics, the grid against interpolation elsewhere."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mpmath import mp
from numpy.typing import NDArray

from earth import WGS84, DisturbanceGrid, gravity_n
from earth._jit import uncached
from earth.disturbance import grid_disturbance
from earth.gravity import _gravity_rows, gravity, gravity_field, kernel_for, needs_place
from tests.earth import exact
from tests.oracles.gravity import normal_gravity_zonal

Array = NDArray[np.float64]
DEG = np.pi / 180.0
ARCSEC = DEG / 3600.0
ROUNDING = 1e-13  # m/s^2: as for normal gravity, a hundred roundings on 10 m/s^2
FIT = 1e-11  # m/s^2: what a named model promises against its formula
DIGITS = 1e-18  # rad, m/s^2: rounding of values of 1e-4 and less


class Mass:
    """A buried point mass: what it does to the gravity of a station, in Earth-fixed axes alone.

    Gravity is the normal vector (oracle) plus the mass's attraction; the zenith is opposite to
    it, and astronomic latitude and longitude are the zenith's.
    """

    def __init__(self, station: tuple[float, float, float], place: tuple[float, float, float]):
        lat, lon, h = station
        C_en = np.array(exact.C_en(mp.mpf(lat), mp.mpf(lon)).tolist(), float)
        normal = normal_gravity_zonal(lat, h)
        normal_e = C_en @ [normal.north, 0.0, normal.down]
        to_mass = [x - y for x, y in zip(exact.ecef(*place), exact.ecef(*station), strict=True)]
        d = np.array(to_mass, float)
        self.pull_e = 2e5 * d / np.linalg.norm(d) ** 3  # m^3/s^2: a 12 km cube, +1700 kg/m^3
        self.gravity_n = C_en.T @ (normal_e + self.pull_e)
        self.pull_n = C_en.T @ self.pull_e
        latitude, longitude = self._zenith(normal_e + self.pull_e)
        normal_latitude, normal_longitude = self._zenith(normal_e)
        self.xi = latitude - normal_latitude
        self.eta = (longitude - normal_longitude) * np.cos(lat)
        self.dg = float(np.linalg.norm(normal_e + self.pull_e) - np.linalg.norm(normal_e))

    @staticmethod
    def _zenith(g_e: Array) -> tuple[float, float]:
        up = -g_e / np.linalg.norm(g_e)
        return np.arctan2(up[2], np.hypot(up[0], up[1])), np.arctan2(up[1], up[0])


STATIONS = [(0.8, -1.9, 0.0), (-0.58, 2.4, 3000.0), (0.02, 0.3, 800.0)]


def beside(station: tuple[float, float, float], north: float, east: float) -> Mass:
    """The mass 15 km down, so many metres north and east."""
    lat, lon, _ = station
    place = (lat + north / 6.37e6, lon + east / 6.37e6 / np.cos(lat), -15_000.0)
    return Mass(station, place)


@pytest.mark.parametrize("station", STATIONS)
@pytest.mark.parametrize(
    ("north", "east"), [(9e3, 0.0), (-9e3, 0.0), (0.0, 9e3), (0.0, -9e3), (5e3, -7e3)]
)
def test_a_buried_mass_pulls_towards_itself(
    station: tuple[float, float, float], north: float, east: float
) -> None:
    """A mass to the north pulls the plumb bob north and so tilts the zenith south: xi < 0."""
    mass = beside(station, north, east)
    assert mass.pull_n[0] * north >= 0.0
    assert mass.xi * north <= 0.0
    assert mass.eta * east <= 0.0
    assert mass.dg > 0.0
    assert max(abs(mass.xi), abs(mass.eta)) > 3.0 * ARCSEC
    xi, eta, dg = mass.xi, mass.eta, mass.dg

    def disturbance(lat, lon, h):
        return xi, eta, dg

    lat, lon, h = station
    field = gravity_field(disturbance=disturbance)
    found = gravity(WGS84.params, field, np.sin(lat), np.cos(lat), lat, lon, h)
    # Left out by definition: deflection (7") times disturbance (70 mGal) and half its square,
    # 3e-8 m/s^2; the signal is 1e-4 m/s^2 and more.
    np.testing.assert_allclose(found, mass.gravity_n, rtol=0.0, atol=3e-8)
    flat = np.ones((2, 2))
    grid = DisturbanceGrid(
        [lat - 0.01, lat + 0.02], [lon - 0.01, lon + 0.01], xi * flat, eta * flat, dg * flat
    )
    on_grid = gravity_n(*station, disturbance=grid)
    np.testing.assert_allclose(on_grid, mass.gravity_n, rtol=0.0, atol=3e-8)


@pytest.mark.parametrize("lat_deg", [45.0, -45.0, 20.0])
def test_documented_difference_of_the_two_deflections(lat_deg: float) -> None:
    """Normal gravity's own zenith leaves the ellipsoid's normal by 0.17" sin(2 lat) per km."""
    normal = normal_gravity_zonal(lat_deg * DEG, 1000.0)
    xi = -normal.north / normal.down
    expected = 0.17 * ARCSEC * np.sin(2.0 * lat_deg * DEG)
    assert xi == pytest.approx(expected, abs=0.005 * ARCSEC)  # half of the last digit printed


def own_gravity(lat, lon, h):
    return 1e-4 * lat, -2e-5 * lon, 9.8 - 3e-6 * h + 1e-3 * lon


def own_disturbance(lat, lon, h):
    return 2e-5 * lat + 1e-9 * h, -3e-5 * lon, 1e-4 * lat * lon + 1e-8 * h


PLACES = np.array([[-1.2, 0.3, 100.0], [0.4, -3.0, 12_000.0], [1.1, 2.2, 40_000.0]])


def test_a_function_instead_of_the_model() -> None:
    found = gravity_n(*PLACES.T, gravity=own_gravity)
    expected = [own_gravity(*place) for place in PLACES]
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=ROUNDING)


def test_a_function_on_top_of_the_model() -> None:
    found = gravity_n(*PLACES.T, disturbance=own_disturbance)
    normal = normal_gravity_zonal(PLACES[:, 0], PLACES[:, 2])
    xi, eta, dg = np.array([own_disturbance(*place) for place in PLACES]).T
    expected = [normal.north - normal.down * xi, -normal.down * eta, normal.down + dg]
    np.testing.assert_allclose(found.T, expected, rtol=0.0, atol=FIT)


@pytest.mark.parametrize("model", ["somigliana", own_gravity])
def test_a_disturbance_on_top_of_anything(model: str | Callable[..., tuple[float, ...]]) -> None:
    below = gravity_n(*PLACES.T, gravity=model)
    found = gravity_n(*PLACES.T, gravity=model, disturbance=own_disturbance)
    added = np.array([own_disturbance(*place) for place in PLACES])
    added[:, :2] *= -below[:, 2:]
    np.testing.assert_allclose(found - below, added, rtol=0.0, atol=ROUNDING)


def test_whole_numbers_are_accepted() -> None:
    def simple(lat, lon, h):
        return 0, 0, 9.81

    np.testing.assert_array_equal(gravity_n(0.5, 0.5, 3.0, gravity=simple), [0.0, 0.0, 9.81])


def test_closed_over_values_are_used() -> None:
    found = []
    for bias in (1e-5, -2e-5):

        def closure(lat, lon, h):
            return 0.0, 0.0, bias  # noqa: B023  # compiled at once, so bound now

        found.append(gravity_n(0.5, 0.5, 3.0, disturbance=closure)[2] - gravity_n(0.5, 0.5, 3.0)[2])
    np.testing.assert_allclose(found, [1e-5, -2e-5], rtol=0.0, atol=ROUNDING)


@pytest.mark.parametrize("choice", [{"gravity": own_gravity}, {"disturbance": own_disturbance}])
def test_plain_and_compiled_functions_agree(choice: dict[str, Callable[..., object]]) -> None:
    field = gravity_field(**choice)  # type: ignore[arg-type]
    assert needs_place(field)
    for lat, lon, h in PLACES:
        plain = gravity(WGS84.params, field, np.sin(lat), np.cos(lat), lon=lon, lat=lat, h=h)
        compiled = gravity_n(lat, lon, h, **choice)  # type: ignore[arg-type]
        np.testing.assert_allclose(plain, compiled, rtol=0.0, atol=ROUNDING)


def test_only_functions_take_a_kernel_off_the_disk() -> None:
    for kept in (gravity_field(), gravity_field("somigliana"), gravity_field(disturbance=REGION)):
        assert kernel_for(_gravity_rows, kept) is _gravity_rows
    for own in (gravity_field(own_gravity), gravity_field(disturbance=own_disturbance)):
        assert kernel_for(_gravity_rows, own) is uncached(_gravity_rows)


def test_a_disturbance_is_a_function_or_a_grid() -> None:
    with pytest.raises(TypeError, match=r"must be a function .* or a DisturbanceGrid, got str"):
        gravity_field(disturbance="egm2008.csv")  # type: ignore[arg-type]  # the point of the test


def bilinear(lat: Array, lon: Array) -> tuple[Array, Array, Array]:
    """Three surfaces that bilinear interpolation reproduces."""
    return (
        1e-5 * (1.0 + 2.0 * lat - 3.0 * lon + 4.0 * lat * lon),
        1e-5 * (-2.0 + lat + lon - 2.0 * lat * lon),
        1e-5 * (3.0 - lat + 2.0 * lon + lat * lon),
    )


LAT = np.linspace(-0.3, 0.5, 9)
LON = np.linspace(-1.0, 0.4, 5)
REGION = DisturbanceGrid(LAT, LON, *bilinear(LAT[:, None], LON))


def on(grid: DisturbanceGrid, lat: float, lon: float) -> tuple[float, ...]:
    return tuple(float(x) for x in grid_disturbance(grid.nodes, lat, lon))


def compiled_on(grid: DisturbanceGrid, lat: float, lon: float) -> tuple[float, ...]:
    """The same from inside a loop, from a field of unit gravity."""
    g_n = gravity_n(lat, lon, 0.0, gravity=unit_gravity, disturbance=grid)
    return float(-g_n[0]), float(-g_n[1]), float(g_n[2] - 1.0)


def unit_gravity(lat, lon, h):
    return 0.0, 0.0, 1.0


@pytest.mark.parametrize(("evaluate", "tolerance"), [(on, 1e-19), (compiled_on, 1e-15)])
def test_between_the_nodes_it_is_bilinear(
    evaluate: Callable[..., tuple[float, ...]], tolerance: float
) -> None:
    """1e-15 is the rounding of 1 + dg; 1e-19 some roundings of 1e-5 (rad, m/s^2)."""
    rng = np.random.default_rng(3)
    for _ in range(50):
        lat, lon = rng.uniform(LAT[0], LAT[-1]), rng.uniform(LON[0], LON[-1])
        truth = bilinear(lat, lon)
        assert evaluate(REGION, lat, lon) == pytest.approx(truth, rel=0.0, abs=tolerance)


def test_on_the_nodes_it_is_the_node_borders_and_corners_included() -> None:
    rng = np.random.default_rng(4)
    values = rng.normal(size=(3, LAT.size, LON.size)) * 1e-4
    grid = DisturbanceGrid(LAT, LON, *values)
    for i, lat in enumerate(LAT):
        for j, lon in enumerate(LON):
            # 1e-15 of a cell off the node, times steps of 3e-4 between nodes
            assert on(grid, lat, lon) == pytest.approx(values[:, i, j], rel=0.0, abs=DIGITS)


@pytest.mark.parametrize(
    ("lat", "lon"),
    [
        (-0.3 - 1e-6, 0.0),
        (0.5 + 1e-6, 0.0),
        (0.1, -1.0 - 1e-6),
        (0.1, 0.4 + 1e-6),
        (1.2, 3.0),
        (0.1, np.nan),
        (np.nan, 0.1),
    ],
)
def test_outside_it_is_not_a_number(lat: float, lon: float) -> None:
    assert np.isnan(on(REGION, lat, lon)).all()
    assert np.isnan(gravity_n(lat, lon, 0.0, disturbance=REGION)).all()


def test_rounding_does_not_push_a_border_outside() -> None:
    rng = np.random.default_rng(5)
    zero = np.zeros((7, 11))
    for south, west, step in zip(
        rng.uniform(-80, 60, 100),
        rng.uniform(-180, 180, 100),
        rng.uniform(0.01, 3, 100),
        strict=True,
    ):
        lat, lon = (south + step * np.arange(7)) * DEG, (west + step * np.arange(11)) * DEG
        grid = DisturbanceGrid(lat, lon, zero, zero, zero)
        for y, x in ((0, 0), (0, -1), (-1, 0), (-1, -1)):
            assert on(grid, lat[y], lon[x]) == (0.0, 0.0, 0.0)


def test_a_place_outside_does_not_touch_its_neighbours() -> None:
    g_n = gravity_n([0.1, 0.6, 0.2], 0.0, 0.0, disturbance=REGION)
    assert np.isnan(g_n).any(axis=1).tolist() == [False, True, False]


@pytest.mark.parametrize("turns", [-2, -1, 1, 3])
def test_a_region_is_found_from_any_count_of_longitude(turns: int) -> None:
    lon = -0.3 + turns * 2.0 * np.pi
    # 4e-15 rad lost in the longitude times 5e-5 per rad
    assert on(REGION, 0.2, lon) == pytest.approx(on(REGION, 0.2, -0.3), rel=0.0, abs=1e-18)


def around(start: float, count: int, repeated: bool) -> DisturbanceGrid:
    """A grid around the Earth, evenly spaced from `start`, deg."""
    lon = start + np.arange(count + repeated) * 360.0 / count
    lat = np.linspace(-90.0, 90.0, 7)
    wave = np.sin(lon * DEG) + 0.3 * np.cos(2.0 * lon * DEG + 0.4)
    values = 1e-5 * (1.0 + 0.01 * lat[:, None]) * wave
    return DisturbanceGrid(lat * DEG, lon * DEG, values, 2.0 * values, -values)


@pytest.mark.parametrize("start", [-180.0, 0.0, -179.5, 17.0])
@pytest.mark.parametrize("repeated", [False, True])
def test_a_grid_around_the_earth_closes_upon_itself(start: float, repeated: bool) -> None:
    """Against NumPy's periodic interpolation, through every seam."""
    grid = around(start, 24, repeated)
    lon = np.concatenate([np.linspace(-200.0, 380.0, 117), [-180.0, 180.0, 0.0, 360.0, 352.1]])
    for lat, row in ((0.0, 3), (90.0, 6), (-90.0, 0)):
        for x in lon:
            truth = np.interp(x, grid.lon / DEG, grid.xi[row], period=360.0)
            found = on(grid, lat * DEG, x * DEG)
            assert found == pytest.approx((truth, 2.0 * truth, -truth), rel=0.0, abs=1e-18)


def test_a_grid_that_lacks_one_column_does_not_close() -> None:
    whole = around(-180.0, 24, repeated=False)
    grid = DisturbanceGrid(
        whole.lat, whole.lon[:-1], whole.xi[:, :-1], whole.eta[:, :-1], whole.dg[:, :-1]
    )
    assert np.isnan(on(grid, 0.1, 172.0 * DEG)).all()
    assert np.isfinite(on(grid, 0.1, 149.9 * DEG)).all()


def test_what_was_checked_cannot_change() -> None:
    values = np.zeros((2, 2))
    grid = DisturbanceGrid([0.0, 0.1], [0.0, 0.1], values, values, values)
    values[:] = 1e-3
    assert on(grid, 0.05, 0.05) == (0.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="read-only"):
        grid.xi[0, 0] = 1.0
    assert grid.nodes is grid.nodes


Z = np.zeros((2, 3))
GOOD = {"lat": [0.1, 0.2], "lon": [0.1, 0.2, 0.3], "xi": Z, "eta": Z, "dg": Z}


def with_one(row: int, column: int, value: float) -> Array:
    values = Z.copy()
    values[row, column] = value
    return values


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"lat": [0.2, 0.1]}, "lat must be finite and increase"),
        ({"lat": [0.1, np.nan]}, "lat must be finite and increase"),
        ({"lat": [0.1]}, "lat must hold two values or more"),
        ({"lat": [50.0, 51.0]}, "degrees are not radians"),
        ({"lon": [0.1, 0.2, 0.31]}, "lon must be evenly spaced"),
        ({"lon": [0.0, 60.0, 120.0]}, "lon must not span more than 2 pi"),
        ({"xi": Z.T}, r"xi must have shape \(2, 3\), got \(3, 2\)"),
        ({"eta": with_one(1, 2, np.nan)}, r"eta\[1, 2\] is nan"),
        ({"xi": with_one(0, 1, -4.0)}, r"xi\[0, 1\] is -4.0, beyond .*arcsec are not rad"),
        ({"dg": with_one(1, 0, 25.0)}, r"dg\[1, 0\] is 25.0, beyond .*mGal are not"),
        (
            {"lon": [-np.pi, 0.0, np.pi], "eta": with_one(1, 2, 1e-5)},
            "eta differs between the first and the last longitude",
        ),
    ],
)
def test_a_grid_that_is_none_is_refused(change: dict[str, object], message: str) -> None:
    DisturbanceGrid(**GOOD)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=message):
        DisturbanceGrid(**{**GOOD, **change})  # type: ignore[arg-type]


HEADER = "lat_deg,lon_deg,xi_arcsec,eta_arcsec,dg_mgal\n"
ROWS = [
    "51.0,-114.0,5.5,-2.25,31.0",
    "51.0,-113.5,5.0,-2.5,30.5",
    "51.0,-113.0,4.5,-2.75,30.0",
    "51.25,-114.0,3.5,1.25,-11.0",
    "51.25,-113.5,3.0,1.5,-10.5",
    "51.25,-113.0,2.5,1.75,-10.0",
]


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "field.csv"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("order", [[0, 1, 2, 3, 4, 5], [4, 0, 5, 3, 1, 2]])
def test_a_file_in_any_order(tmp_path: Path, order: list[int]) -> None:
    path = written(tmp_path, HEADER + "\n".join(ROWS[k] for k in order) + "\n\n")
    grid = DisturbanceGrid.read(path)
    degree = 0.017453292519943295  # rad
    np.testing.assert_allclose(grid.lat, np.array([51.0, 51.25]) * degree, rtol=1e-15)
    np.testing.assert_allclose(grid.lon, np.array([-114.0, -113.5, -113.0]) * degree, rtol=1e-15)
    # 1" = 4.84813681109536e-6 rad, 1 mGal = 1e-5 m/s^2
    np.testing.assert_allclose(grid.xi[1], np.array([3.5, 3.0, 2.5]) * 4.84813681109536e-6)
    np.testing.assert_allclose(grid.eta[0], np.array([-2.25, -2.5, -2.75]) * 4.84813681109536e-6)
    np.testing.assert_allclose(grid.dg[:, 2], [30.0e-5, -10.0e-5])
    middle = on(grid, 51.125 * degree, -113.75 * degree)
    expected = (4.25 * 4.84813681109536e-6, -0.5 * 4.84813681109536e-6, 10.0e-5)
    # 5 digits of the coordinates' rounding: 1e-14 rad of 1e-3 rad steps
    assert middle == pytest.approx(expected, rel=0.0, abs=1e-15)


def test_coordinates_rounded_by_the_writer_are_even_enough(tmp_path: Path) -> None:
    lat = [f"{10 + k / 60:.5f}" for k in range(40)]
    lon = [f"{-0.2 + k / 60:.5f}" for k in range(25)]
    text = HEADER + "\n".join(f"{x},{y},1,2,3" for x in lat for y in lon)
    assert DisturbanceGrid.read(written(tmp_path, text)).xi.shape == (40, 25)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "must begin with the line lat_deg,lon_deg,xi_arcsec,eta_arcsec,dg_mgal, got ''"),
        ("lat,lon,xi,eta,dg\n" + ROWS[0], "must begin with the line .*, got 'lat,lon,xi,eta,dg'"),
        (HEADER, "holds no node"),
        (HEADER + ROWS[0] + "\n51.0,-113.5,5.0\n", "line 3: expected five numbers"),
        (HEADER + "51.0,-113.5,5.0,x,1\n", "line 2: expected five numbers, got '51.0,-113.5,5"),
        (HEADER + "\n".join(ROWS[:5]), r"the node at 51.25°, -113° comes 0 times, not once"),
        (HEADER + "\n".join([*ROWS, ROWS[1]]), r"the node at 51°, -113.5° comes 2 times"),
        (HEADER + "\n".join([*ROWS[:5], "51.25,-113.0,nan,0,0"]), "not finite"),
        (HEADER + "\n".join(ROWS).replace("-113.5", "-113.6"), "field.csv: lon must be evenly"),
        (HEADER + "\n".join(ROWS).replace("5.5", "5500"), "field.csv: xi.0, 0. is .* beyond"),
    ],
)
def test_a_damaged_file_is_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        DisturbanceGrid.read(written(tmp_path, text))
