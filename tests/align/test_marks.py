"""Marks in every format surveyors use; what is missing, ambiguous or wrong in them; lever arms."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from align.survey import Mark, SurveyError, azimuth_between, choose, displaced, read_marks
from align.survey.files import marks_of
from align.survey.marks import ned_sigmas
from tests.align.naive import DEG, local_axes, turn, xyz

FOLDER = Path(__file__).parent / "marks"
PIER = (51 + 4 / 60 + 47.83270 / 3600) * DEG, -(114 + 8 / 60 + 1.36060 / 3600) * DEG, 1118.5
TARGET = (51 + 4 / 60 + 57.10412 / 3600) * DEG, -(114 + 7 / 60 + 31.98425 / 3600) * DEG, 1121.25
FILES = ["surveyor.csv", "datasheet.txt", "solution.snx", "points.geojson"]


def off(mark: Mark, place: tuple[float, float, float]) -> float:
    """Distance of a mark from a place, m."""
    assert mark.h is not None
    return float(np.linalg.norm(xyz(mark.lat, mark.lon, mark.h) - xyz(*place)))


def one(text: str, file: str = "marks") -> Mark:
    (mark,) = marks_of(text, file)
    return mark


def refusal(text: str) -> str:
    with pytest.raises(SurveyError) as caught:
        marks_of(text, "marks")
    assert str(caught.value).startswith("marks")
    assert "\n" not in str(caught.value)
    return str(caught.value)


# ---- the same two marks ------------------------------------------------------------------------


@pytest.mark.parametrize("file", FILES)
def test_the_same_marks_in_every_format(file: str) -> None:
    marks = read_marks(FOLDER / file)
    pier, target = choose(marks, "PIER 1"), choose(marks, "AZ MK")
    assert len(marks) == 2
    # 1e-8 m: digits of the SINEX file
    assert off(pier, PIER) < 2e-8
    assert off(target, TARGET) < 2e-8
    assert pier.sigmas == pytest.approx((0.005, 0.005, 0.005), rel=1e-12)
    assert str(FOLDER / file) in pier.source


def test_every_format_gives_the_same_azimuth() -> None:
    found = []
    for file in FILES:
        marks = read_marks(FOLDER / file)
        found.append(azimuth_between(choose(marks, "PIER 1"), choose(marks, "AZ MK")))
    for other in found[1:]:
        # 1e-8 m of the SINEX digits over 640 m
        assert turn(other.azimuth, found[0].azimuth) == pytest.approx(0.0, abs=1e-10)
        assert other.sigma == pytest.approx(found[0].sigma, rel=1e-9)


def test_frames_and_epochs_are_carried() -> None:
    said = {file: choose(read_marks(FOLDER / file), "PIER 1") for file in FILES}
    assert [said[file].frame for file in FILES] == [
        "NAD 83(2011)",
        "NAD 83(2011)",
        "ITRF2014",
        "WGS 84",
    ]
    assert [said[file].epoch for file in FILES[:2]] == [2010.0, 2010.0]
    assert said["solution.snx"].epoch == pytest.approx(2026.0 + 0.5 / 365.0, abs=1e-5)
    mixed = azimuth_between(
        said["surveyor.csv"], choose(read_marks(FOLDER / "solution.snx"), "AZMK")
    )
    assert any("NAD 83(2011) and AZMK in ITRF2014" in warning for warning in mixed.warnings)


def test_names_and_aliases() -> None:
    sheets = read_marks(FOLDER / "datasheet.txt")
    assert choose(sheets, "zz0002").name == "AZ MK"
    solution = read_marks(FOLDER / "solution.snx")
    for name in ("PIR1", "pir1", "49901M001", "PIER 1", "PIR1:1"):
        assert choose(solution, name).name == "PIR1"
    with pytest.raises(SurveyError, match="there is no mark AZ MRK; the nearest name is AZ MK"):
        choose(sheets, "AZ MRK")
    twice = [*sheets, *sheets]
    with pytest.raises(SurveyError, match=r"2 marks are called AZ MK: ZZ0002 \(.*line 37\); ZZ"):
        choose(twice, "AZ MK")


# ---- tables ------------------------------------------------------------------------------------

PLAIN = "name,latitude,longitude,height\nA,51.07995,-114.13371,1118.5\n"


@pytest.mark.parametrize(
    "text",
    [
        PLAIN,
        "H_ell;Long;PHI;Point ID\n1118,5;-114,13371;51,07995;A\n",
        "lng\tlat\th\tid\n-114.13371\t51.07995\t1118.5\tA\n",
        "# from the field\n\nName, Lat (deg), Lon [deg], Ellipsoidal Height (m)\n"
        "A, 51.07995, -114.13371, 1118.5\n",
        'name,lat,lon,ellip_ht_mm,code\nA,N51.07995,"114.13371 W",1118500,"a, b"\n',
        "name,lat,lon,orthometric_height,geoid_height\nA,51.07995,-114.13371,1135.25,-16.75\n",
        "name,lat,lon,elevation,height_kind\nA,51.07995,-114.13371,1118.5,ellipsoidal\n",
        "name,lat,lon,height,elevation\nA,51.07995,-114.13371,1118.5,1135\n",
        "\ufeffname,φ,λ,h\nA,51°04'47.82\",W114°08'01.356\",1118.5\n".lstrip("\ufeff"),
    ],
)
def test_tables_in_many_hands(text: str) -> None:
    mark = one(text)
    assert mark.name == "A"
    # 1e-6 m: far below the digits written
    assert off(mark, (51.07995 * DEG, -114.13371 * DEG, 1118.5)) < 1e-6
    assert mark.height() == mark.h


def test_a_table_with_names_and_numbers() -> None:
    mark = one("id,name,lat,lon\n0012,A,51,-114\n")
    assert (mark.name, mark.aliases) == ("A", ("0012",))
    assert one("id,lat,lon\n0012,51,-114\n").name == "0012"


def test_a_table_of_x_y_z(tmp_path: Path) -> None:
    x, y, z = xyz(*PIER).tolist()
    path = tmp_path / "xyz.csv"
    path.write_bytes(
        f"NAME,X,Y,Z,SD_X,SD_Y,SD_Z,Epoch,Frame\nA\xb0,{x!r},{y!r},{z!r},0.01,0.02,0.04,2020-07-01,"
        "ETRS89\n".encode("latin-1")
    )
    (mark,) = read_marks(path)
    assert mark.name == "A°"
    assert off(mark, PIER) < 1e-8
    assert mark.frame == "ETRS89"
    assert mark.epoch == pytest.approx(2020.0 + 182.0 / 366.0, abs=1e-9)
    north, east, up = local_axes(PIER[0], PIER[1])
    for found, axis in zip(mark.sigmas or (), (north, east, up), strict=True):
        assert found == pytest.approx(
            math.sqrt(sum((s * a) ** 2 for s, a in zip((0.01, 0.02, 0.04), axis, strict=True))),
            rel=1e-12,
        )
    assert ned_sigmas((0.01, 0.02, 0.04), mark.lat, mark.lon) == pytest.approx(mark.sigmas)


def test_sigmas_of_a_table_have_units() -> None:
    head = "name,lat,lon,h,"
    row = "A,51,-114,1,"
    assert one(f"{head}sigma_n_mm,sigma_e (cm),sd_h\n{row}5,2,0.03\n").sigmas == pytest.approx(
        (0.005, 0.02, 0.03)
    )
    assert one(f"{head}sigma\n{row}0.004\n").sigmas == (0.004, 0.004, 0.004)
    assert one(f"{head}sigma\n{row}\n").sigmas is None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is neither a table with headers"),
        ("hello\nworld\n", "is neither a table with headers"),
        ("\x00\x01,\x02", "is neither a table with headers"),
        ("name,latitude,longitude\n", "has headers and no marks"),
        ("latitude,longitude,ID\n51,-114,\n", "line 2: the mark has no name"),
        ("latitude,longitude\n51,-114\n", "line 1: there is no column name"),
        ("name,Easting,Northing\nA,1,2\n", "grid coordinates (Easting) are not read"),
        ("name,latitude\nA,51\n", "give columns latitude and longitude, or x, y and z"),
        ("name,lat,lon,latitude\nA,1,2,1\n", "two columns hold the latitude"),
        ("name,lat,lon,height_ft\nA,1,2,3\n", "column 'height_ft' is in ft; give meters"),
        ("name,lat_rad,lon\nA,1,2\n", "column 'lat_rad' is in rad; give degrees"),
        (PLAIN.replace("1118.5", "high"), "line 2: height 'high' is not a number"),
        (PLAIN.replace("1118.5", "nan"), "line 2: height nan is not a number"),
        (PLAIN.replace("A,", ",", 1), "line 2: the mark has no name"),
        (PLAIN.replace("51.07995", ""), "line 2: latitude is missing"),
        (PLAIN.replace("51.07995", "-114.1"), "are latitude and longitude swapped?"),
        (PLAIN.replace("51.07995", "114 08 W"), "are latitude and longitude swapped?"),
        (PLAIN.replace("51.07995", "51 64 00 N"), "line 2: latitude '51 64 00 N' has minutes"),
        (PLAIN.replace("1118.5", "1118,5"), "5 values under 4 headers"),
        ("name,x,y,z\nA,1,,3\n", "line 2: x, y and z go together"),
        ("name,x,y,z\nA,-1641.9,-3664.8,4940.0\n", "km from the Earth's center"),
        ("name,x,y,z,lat,lon\nA,-1641936.9,-3664809.5,4940007.7,51.07,-114.13371\n", "m apart"),
        ("name,lat,lon,h,sigma\nA,1,2,3,-1\n", "a sigma is negative"),
        ("name,lat,lon,h,sigma_n\nA,1,2,3,1\n", "sigma_n, sigma_e and sigma_u go together"),
        ("name,lat,lon,h,epoch\nA,1,2,3,soon\n", "epoch 'soon' is no year"),
        ("name,lat,lon,alt,height_kind\nA,1,2,3,sea\n", "'sea' is not one of ellipsoidal"),
    ],
)  # fmt: skip
def test_a_wrong_table_names_line_and_way_out(text: str, said: str) -> None:
    assert said in refusal(text)


# ---- heights -----------------------------------------------------------------------------------


def test_an_orthometric_height_needs_the_geoid() -> None:
    mark = one("name,lat,lon,orthometric_height\nA,51,-114,1135.25\n")
    with pytest.raises(SurveyError, match=r"line 2\) has only an orthometric height, 1135.25 m"):
        mark.height()
    assert mark.height(-16.75) == 1118.5
    with pytest.raises(SurveyError, match="no height_kind"):
        mark.height(-16.75, "orthometric")


@pytest.mark.parametrize("header", ["elevation", "Altitude (m)", "H"])
def test_a_height_above_nothing_said_is_refused(header: str) -> None:
    mark = one(f"name,lat,lon,{header}\nA,51,-114,1135.25\n")
    with pytest.raises(SurveyError, match="nothing says above what"):
        mark.height()
    assert mark.height(kind="ellipsoidal") == 1135.25
    assert mark.height(-16.75, "orthometric") == 1118.5
    with pytest.raises(SurveyError, match="only an orthometric height"):
        mark.height(kind="orthometric")


def test_heights_that_are_none_or_need_no_geoid() -> None:
    with pytest.raises(SurveyError, match=r"mark A .* has no height"):
        one("name,lat,lon\nA,51,-114\n").height()
    with pytest.raises(SurveyError, match="geoid_height_m has nothing to belong to"):
        one(PLAIN).height(-16.75)


# ---- GeoJSON -----------------------------------------------------------------------------------


def geojson(**changes: object) -> str:
    feature = {
        "type": "Feature",
        "geometry": {"type": "Point", "coordinates": [-114.13371, 51.07995, 1118.5]},
        "properties": {"name": "A", "datum": "NAD 83(2011)", "sigma_cm": 2.0, "note": None},
    }
    return json.dumps({**feature, **changes})


def test_a_point_of_geojson() -> None:
    mark = one(geojson())
    assert (mark.name, mark.frame) == ("A", "NAD 83(2011)")
    assert mark.sigmas == pytest.approx((0.02, 0.02, 0.02))
    assert off(Mark("", mark.lat, mark.lon, 0.0), (51.07995 * DEG, -114.13371 * DEG, 0.0)) < 1e-6
    with pytest.raises(
        SurveyError, match=r"1118\.5 m, but nothing says above what; give height_kind"
    ):
        mark.height()
    named = one(
        geojson(
            id=7, properties={"x": 5e5, "y": 5e6, "orthometric_height": 3.0, "geoid_height": -1.0}
        )
    )
    assert (named.name, named.height(), named.frame) == ("7", 2.0, "WGS 84")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('{"type": "Feature",\n x}', "line 2: is not JSON"),
        ('{"name": "A"}', "is not GeoJSON"),
        ('{"type": "FeatureCollection", "features": 3}', "is not GeoJSON"),
        ('{"type": "FeatureCollection", "features": []}', "no feature with a Point"),
        (geojson(geometry={"type": "LineString", "coordinates": []}), "no feature with a Point"),
        (geojson(geometry={"type": "Point", "coordinates": [1]}), "has 2 or 3 numbers, got [1]"),
        (geojson(geometry={"type": "Point", "coordinates": [51.0, -114.0]}), "swapped?"),
        (geojson(properties={"name": "A", "sigma_ft": 1}), "is in ft; give meters"),
        (geojson(crs={"properties": {"name": "urn:ogc:def:crs:EPSG::32612"}}), "EPSG::32612"),
    ],
)
def test_wrong_geojson_is_refused(text: str, said: str) -> None:
    assert said in refusal(text)


def test_the_old_name_of_wgs84_is_accepted() -> None:
    assert one(geojson(crs={"properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}})).name == "A"


# ---- NGS ---------------------------------------------------------------------------------------

SHEET = (FOLDER / "datasheet.txt").read_text()
ELLIPSOID = next(line for line in SHEET.splitlines() if "ELLIP HT" in line)
POSITION = next(line for line in SHEET.splitlines() if "POSITION" in line)
NETWORK = next(line for line in SHEET.splitlines() if "  NETWORK" in line)
GEOID = next(line for line in SHEET.splitlines() if "GEOID HEIGHT" in line)


def sheet(old: str, new: str) -> Mark:
    assert old in SHEET
    return marks_of(SHEET.replace(old, new, 1), "sheet")[0]


def test_a_sheet_without_ellipsoid_height_adds_the_geoid() -> None:
    mark = sheet(ELLIPSOID + "\n", "")
    assert mark.h == 1135.25 - 16.75
    assert mark.notes == ("its ellipsoid height is from NAVD 88 and GEOID18",)
    bare = marks_of(SHEET.replace(ELLIPSOID, "").replace(GEOID, "", 1), "sheet")[0]
    with pytest.raises(SurveyError, match=r"only an orthometric height, 1135\.25 m"):
        bare.height()


def test_sigmas_of_a_sheet_are_centimeters_north_east_up() -> None:
    mark = sheet(NETWORK, NETWORK.replace("0.50   0.50   0.50", "0.31   0.27   1.12"))
    assert mark.sigmas == pytest.approx((0.0031, 0.0027, 0.0112))
    assert sheet(NETWORK, "").sigmas is None


def test_other_hands_of_a_sheet() -> None:
    """Older layout, southern and eastern letters, positions of lesser quality, no designation."""
    old = POSITION.replace(" POSITION- ", "-          ").replace("2011", "1986")
    assert sheet(POSITION, old).frame == "NAD 83(1986)"
    south = sheet(POSITION, POSITION.replace("(N)", "(S)").replace("(W)", "(E)"))
    assert (south.lat, south.lon) == pytest.approx((-PIER[0], -PIER[1]), abs=1e-15)
    scaled = POSITION.replace("ADJUSTED", "SCALED").replace("47.83270(N)", "48.    (N)")
    assert sheet(POSITION, scaled).notes == (
        "its position was scaled from a map, good to 6″ (200 m)",
    )
    held = sheet(POSITION, POSITION.replace("ADJUSTED", "HD_HELD1"))
    assert held.notes == ("its position is from a hand-held receiver, good to 10 m",)
    bare = sheet(" ZZ0001  DESIGNATION -  PIER 1\n", "")
    assert (bare.name, bare.aliases) == ("ZZ0001", ())


def test_wrong_sheets_are_refused() -> None:
    assert "has a POSITION of current survey control" in refusal(SHEET.replace("POSITION", "PLACE"))
    wrong = refusal(SHEET.replace("51 04 47.83270(N)", "51 64 47.83270(N)"))
    assert "line 12: '51 64 47.83270 N' has minutes or seconds of 60 or more" in wrong


# ---- SINEX -------------------------------------------------------------------------------------

SOLUTION = (FOLDER / "solution.snx").read_text()
FIRST_X = next(line for line in SOLUTION.splitlines() if "STAX   PIR1" in line)


def test_solutions_of_one_site_are_told_apart() -> None:
    again = SOLUTION.replace("AZMK  A    1", "PIR1  A    2")
    marks = marks_of(again, "snx")
    assert choose(marks, "PIR1:2").lat == pytest.approx(TARGET[0], abs=1e-14)
    with pytest.raises(SurveyError, match=r"2 marks are called PIR1: .*PIR1:1 .*PIR1:2"):
        choose(marks, "PIR1")


@pytest.mark.parametrize(
    ("comment", "frame", "notes"),
    [
        (" Coordinates in ITRF2014", "ITRF2014", 0),
        (" frame of IGS: IGb14", "IGb14", 0),
        (" ETRF2000", "ETRF2000", 0),
        (" nothing", None, 0),
        (" ITRF2014 to NAD 83(2011)", None, 1),
        (" IGS14, aligned to ITRF2014", "IGS14", 0),
    ],
)
def test_the_frame_of_a_solution(comment: str, frame: str | None, notes: int) -> None:
    mark = marks_of(SOLUTION.replace(" Coordinates in ITRF2014", comment), "snx")[0]
    assert mark.frame == frame
    assert len(mark.notes) == notes


@pytest.mark.parametrize(
    ("old", "new", "year"),
    [
        ("26:001:43185 m", "99:001:00000 m", 1999.0),
        ("26:001:43185 m", "00:000:00000 m", None),
        ("26:001:43185 m", "20:184:00000 m", 2020.0 + 183.0 / 366.0),
    ],
)
def test_epochs_of_a_solution(old: str, new: str, year: float | None) -> None:
    assert marks_of(SOLUTION.replace(old, new), "snx")[0].epoch == pytest.approx(year, abs=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("+SOLUTION/ESTIMATE", "+SOLUTION/APRIORI", "has no STAX, STAY, STAZ"),
        (FIRST_X + "\n", "", "line 21: PIR1 lacks one of STAX, STAY, STAZ"),
        ("-1.64193692930179e+06", "-1.6419369293O179e+06", "line 21: is no line of SOLUTION"),
        ("-1.64193692930179e+06", "-1.64193692930179e+03", "from the Earth's center"),
        ("26:001:43185 m    2 -1.64193", "2026-01-01   m    2 -1.64193", "line 21: is no line"),
        ("5.00000e-03", "        nan", "line 21: is no line of SOLUTION"),
        ("26:001:43185 m    2 -1.64193", "26:001:43185 km   2 -1.64193", "STAX is in km"),
    ],
)
def test_wrong_solutions_are_refused(old: str, new: str, said: str) -> None:
    assert old in SOLUTION
    assert said in refusal(SOLUTION.replace(old, new, 1))


# ---- RINEX -------------------------------------------------------------------------------------

HEADER = (FOLDER / "pier.rnx").read_text()


def test_a_rinex_header() -> None:
    mark = one(HEADER)
    assert (mark.name, mark.aliases, mark.sigmas, mark.frame) == (
        "PIER 1", ("49901M001",), None, None,
    )  # fmt: skip
    assert off(mark, PIER) < 1e-4  # digits of the header
    assert "approximate" in mark.notes[0]
    assert "1.5 m above, 0 m east and 0 m north of the mark" in mark.notes[1]
    assert len(one(HEADER.replace("1.5000", "0.0000")).notes) == 1
    second = HEADER.replace("3.04           OBSERVATION", "2.11           OBSERVATION")
    assert one(second).name == "PIER 1"
    assert one(HEADER.replace("PIER 1", "      ")).name == "49901M001"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("APPROX POSITION XYZ", "COMMENT            ", "its header has no APPROX POSITION XYZ"),
        ("-1641936.9293", " 164193.69.29", "line 5: APPROX POSITION XYZ has no three numbers"),
        ("-1641936.9293", "      36.9293", "line 5: X, Y, Z = 36.9293"),
        (
            " -1641936.9293 -3664809.4959  4940007.6642",
            "        0.0000        0.0000        0.0000",
            "line 5: its header has no APPROX POSITION XYZ",
        ),
        ("OBSERVATION DATA    G                   ", "x" * 40, None),
    ],
)
def test_wrong_headers_are_refused(old: str, new: str, said: str | None) -> None:
    assert old in HEADER
    text = HEADER.replace(old, new)
    if said is None:
        assert one(text).name == "PIER 1"
    else:
        assert said in refusal(text)


def test_files_that_are_not_there() -> None:
    with pytest.raises(SurveyError, match=r"nowhere\.csv: no such file of marks"):
        read_marks(FOLDER / "nowhere.csv")
    with pytest.raises(SurveyError, match="cannot be read"):
        read_marks(FOLDER)


# ---- lever arms --------------------------------------------------------------------------------


@pytest.mark.parametrize("place", [PIER, (-0.6, 2.6, 20.0), (1.5, 3.1, -3.0), (0.0, 0.0, 0.0)])
def test_a_lever_arm_leads_where_it_points(place: tuple[float, float, float]) -> None:
    arm = np.array([12.0, -7.0, 3.0])  # m, north, east, down
    north, east, up = local_axes(place[0], place[1])
    wanted = xyz(*place) + arm[0] * north + arm[1] * east - arm[2] * up
    # 1e-8 m: geodetic coordinates and back
    assert xyz(*displaced(*place, arm)) == pytest.approx(wanted, abs=1e-8)
    enu = [arm[1], arm[0], -arm[2]]
    assert xyz(*displaced(*place, enu, "ENU")) == pytest.approx(wanted, abs=1e-8)
