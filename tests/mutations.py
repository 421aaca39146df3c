"""Break the code on purpose and see a test go red: ``python -m tests.mutations``.

All of them take an hour; ``--share 4 --turn N`` tries every fourth, another quarter for each N.

Each mutation is one replacement in one file of a copy of the repository. The tests named with it
must fail there; a mutation that survives, or whose text is no longer in the code, fails the run.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PARTS = ("earth", "align", "navgrade", "tests", "data", "pyproject.toml")
STEP = "navgrade/mechanization/step.py"
NED = "navgrade/mechanization/ned.py"
TERMS = "navgrade/mechanization/terms.py"
CARTESIAN = "navgrade/mechanization/cartesian.py"
WANDER = "navgrade/mechanization/wander.py"
PRODUCTS = "navgrade/reconstruction/products.py"
CENTRED = "navgrade/reconstruction/centred.py"
CONING = "navgrade/reconstruction/coning.py"

HOURS = "tests/navgrade/test_accuracy.py"
TURNS = f"{HOURS}::test_hour[turning vehicle, causal-3, n]"
MANOEUVRES = f"{HOURS}::test_hour[manoeuvres, centred-9, n]"
FRAMES = "tests/navgrade/test_frames.py"
CRUISE = f"{FRAMES}::test_cruise_in_long_steps"
LAWS = "tests/navgrade/test_laws.py"
BODY = "tests/navgrade/test_reconstruction.py"
CONES = "tests/navgrade/test_coning.py"
STRETCHES = "tests/navgrade/test_stretches.py"
CHANNEL = "tests/navgrade/test_vertical_loop.py"
FIELD = "tests/navgrade/test_gravity_choice.py"
IMU_ENTRIES = "navgrade/logs/schemas/imu.py"
SCHEMAS = "tests/navgrade/logs/test_schemas.py"
TIMES = "tests/navgrade/logs/test_times.py"
AIDING = "tests/navgrade/logs/test_aiding.py"
PLACES = "navgrade/logs/poses.py"
POSES = "tests/navgrade/logs/test_poses.py"
WRITER = "navgrade/logs/container/writer.py"
WRITTEN = "tests/navgrade/logs/test_writer.py"
IMU_TOPIC = "navgrade/logs/imu_topic.py"
CONVERTED = "tests/navgrade/logs/test_convert.py"
TABLES = "navgrade/logs/tables.py"
READ_TABLES = "tests/navgrade/logs/test_tables.py"


@dataclass(frozen=True)
class Mutation:
    """One deliberate fault and the tests that must see it."""

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]


MUTATIONS = (
    Mutation(
        "Earth rate 1 % off",
        "earth/rates.py",
        "return params.omega * cos_lat, -params.omega * sin_lat",
        "return 1.01 * params.omega * cos_lat, -1.01 * params.omega * sin_lat",
        (TURNS,),
    ),
    Mutation(
        "transport rate about east, sign",
        "earth/rates.py",
        "return north, -v_n * per_meridian, -north * tan_lat",
        "return north, v_n * per_meridian, -north * tan_lat",
        (TURNS,),
    ),
    Mutation(
        "transport rate about down, sign",
        "earth/rates.py",
        "return north, -v_n * per_meridian, -north * tan_lat",
        "return north, -v_n * per_meridian, north * tan_lat",
        (TURNS,),
    ),
    Mutation(
        "radii exchanged",
        "earth/geodetic.py",
        "cube / (params.a * (1.0 - params.e2) + h * cube), root / (params.a + h * root)",
        "root / (params.a + h * root), cube / (params.a * (1.0 - params.e2) + h * cube)",
        (TURNS,),
    ),
    Mutation(
        "north gravity dropped",
        "earth/gravity.py",
        "return north * sin_lat * cos_lat * h, down",
        "return 0.0 * north, down",
        (TURNS,),
    ),
    Mutation(
        "sign of the deflection east",
        "earth/gravity.py",
        "g[1] - g[2] * eta",
        "g[1] + g[2] * eta",
        (FIELD,),
    ),
    Mutation(
        "n: Coriolis sign",
        TERMS,
        "return g[0] - coriolis[0], g[1] - coriolis[1], g[2] - coriolis[2]",
        "return g[0] + coriolis[0], g[1] + coriolis[1], g[2] + coriolis[2]",
        (TURNS,),
    ),
    Mutation(
        "n: Coriolis sign, east",
        TERMS,
        "g[1] - coriolis[1]",
        "g[1] + coriolis[1]",
        (TURNS,),
    ),
    Mutation(
        "n: Coriolis sign, down",
        TERMS,
        "g[2] - coriolis[2]",
        "g[2] + coriolis[2]",
        (TURNS,),
    ),
    Mutation(
        "n: transport left out of the frame's rate",
        TERMS,
        "return ie_n + en[0], en[1], ie_d + en[2]",
        "return ie_n, en[1], ie_d",
        (TURNS,),
    ),
    Mutation(
        "n: Coriolis without transport",
        NED,
        "cross((2.0 * ie_n + en[0], en[1], 2.0 * ie_d + en[2]), v)",
        "cross((2.0 * ie_n, 0.0, 2.0 * ie_d), v)",
        (TURNS,),
    ),
    Mutation(
        "e: Coriolis sign along x",
        CARTESIAN,
        "- excess * r[0] + 2.0 * spin * v[1]",
        "- excess * r[0] - 2.0 * spin * v[1]",
        (FRAMES,),
    ),
    Mutation(
        "e: Coriolis sign along y",
        CARTESIAN,
        "- excess * r[1] - 2.0 * spin * v[0]",
        "- excess * r[1] + 2.0 * spin * v[0]",
        (FRAMES,),
    ),
    Mutation(
        "i: centrifugal sign",
        CARTESIAN,
        "- excess * r[0] + 2.0 * spin * v[1]",
        "+ excess * r[0] + 2.0 * spin * v[1]",
        (FRAMES,),
    ),
    Mutation(
        "i: centrifugal sign along y",
        CARTESIAN,
        "- excess * r[1] - 2.0 * spin * v[0]",
        "+ excess * r[1] - 2.0 * spin * v[0]",
        (FRAMES,),
    ),
    Mutation(
        "i: velocity of the Earth's surface, sign",
        CARTESIAN,
        "v[0] + drift * r[1], v[1] - drift * r[0]",
        "v[0] - drift * r[1], v[1] + drift * r[0]",
        (FRAMES,),
    ),
    Mutation(
        "i: a height correction left behind by the Earth",
        CARTESIAN,
        "carried = drift * dh",
        "carried = 0.0 * dh",
        (CHANNEL,),
    ),
    Mutation(
        "w: Coriolis sign",
        WANDER,
        "- north_y * g_e - coriolis[0]",
        "- north_y * g_e + coriolis[0]",
        (FRAMES,),
    ),
    Mutation(
        "w: Coriolis sign, second axis",
        WANDER,
        "north_x * g_e - coriolis[1]",
        "north_x * g_e + coriolis[1]",
        (FRAMES,),
    ),
    Mutation(
        "w: Coriolis sign, down",
        WANDER,
        "g_d - coriolis[2]",
        "g_d + coriolis[2]",
        (FRAMES,),
    ),
    Mutation(
        "w: transport sign, first axis",
        WANDER,
        "(K_xy * moved[0] + K_yy * moved[1]",
        "(K_xy * moved[0] - K_yy * moved[1]",
        (FRAMES,),
    ),
    Mutation(
        "w: Earth rate left out of the frame's rate",
        WANDER,
        "(ie[0] + ew[0], ie[1] + ew[1], ie[2])",
        "(ew[0], ew[1], ie[2])",
        (FRAMES,),
    ),
    Mutation(
        "w: transport sign",
        WANDER,
        "-(K_xx * moved[0] + K_xy * moved[1]), 0.0",
        "(K_xx * moved[0] + K_xy * moved[1]), 0.0",
        (FRAMES,),
    ),
    Mutation(
        "w: curvature without torsion",
        WANDER,
        "k * p[0] * p[1]",
        "0.0 * p[0] * p[1]",
        (FRAMES,),
    ),
    Mutation(
        "step: frame rotation of the velocity increment dropped",
        STEP,
        "A[1] + (rest[1] * dt + turn[1])",
        "A[1] + rest[1] * dt",
        (MANOEUVRES,),
    ),
    Mutation(
        "step: second order of that rotation dropped",
        STEP,
        "D[1] - (dt * A[1] - k * W[1])",
        "D[1] - dt * A[1]",
        (CRUISE,),
    ),
    Mutation(
        "step: slope of gravity and Coriolis dropped",
        STEP,
        "k = half - half * (1.0 / 3.0) * (dt / (dt + dt_before))",
        "k = half",
        (CRUISE,),
    ),
    Mutation(
        "step: position summed without compensation",
        "earth/summation.py",
        "return new, (new - total) - y",
        "return new, 0.0 * y",
        (LAWS,),
    ),
    Mutation(
        "baro: sign of the velocity gain",
        STEP,
        "(channel.c2 * excess + bias) * dt",
        "(bias - channel.c2 * excess) * dt",
        (CHANNEL,),
    ),
    Mutation(
        "baro: sign of the third gain",
        STEP,
        "bias = bias + channel.c3 * excess * dt",
        "bias = bias - channel.c3 * excess * dt",
        (CHANNEL,),
    ),
    Mutation(
        "coning term deleted",
        PRODUCTS,
        "(theta[0] + coning[0], theta[1] + coning[1], theta[2] + coning[2])",
        "theta",
        (CONES,),
    ),
    Mutation(
        "half of sculling deleted",
        PRODUCTS,
        "+ sculling_v[2] + sculling_theta[2]",
        "+ sculling_v[2]",
        (CONES,),
    ),
    Mutation(
        "rotation term halved to theta x v / 2",
        PRODUCTS,
        "v[0] + r1 * turn[0] + r2 * turn2[0]",
        "v[0] + 0.5 * turn[0]",
        (BODY,),
    ),
    Mutation(
        "displacement without its slope",
        PRODUCTS,
        "(slope[0] + 0.5 * turn[0])",
        "(0.5 * turn[0])",
        (BODY,),
    ),
    Mutation(
        "a weight of four previous samples",
        CONING,
        "367 / 2520",
        "366 / 2520",
        (CONES,),
    ),
    Mutation(
        "a weight of the block of four",
        CONING,
        "92 / 105",
        "91 / 105",
        (CONES,),
    ),
    Mutation(
        "uneven intervals taken as even",
        CONING,
        "return abs(dt[k] - dt[k - 1]) <= _EQUAL * dt[k]",
        "return True",
        (CONES,),
    ),
    Mutation(
        "uneven weights for the wrong length",
        CONING,
        "0.5 * (2.0 * span / dt[k])",
        "0.5 * (2.0 * span / dt[k - 1])",
        (CONES,),
    ),
    Mutation(
        "sculling of the sum in place of the last sample",
        PRODUCTS,
        "cross(A, v_last)",
        "cross(A, v)",
        (CONES,),
    ),
    Mutation(
        "centred: second Magnus coefficient",
        CENTRED,
        "combined(1.0 / 30.0, e2, -1.0 / 60.0, K)",
        "combined(1.0 / 31.0, e2, -1.0 / 60.0, K)",
        (BODY,),
    ),
    Mutation(
        "centred: triple bracket sign",
        CENTRED,
        "combined(1.0 / 60.0, e2, -1.0 / 360.0, K)",
        "combined(1.0 / 60.0, e2, 1.0 / 360.0, K)",
        (BODY,),
    ),
    Mutation(
        "centred: highest coning terms dropped",
        CENTRED,
        "combined(1.0 / 126.0, e4, -1.0 / 70.0, e2)",
        "combined(1.0 / 126.0, e4, 0.0, e2)",
        (BODY,),
    ),
    Mutation(
        "centred: displacement of the slope",
        CENTRED,
        "(1.0 / 60.0) * push[0] - (1.0 / 6.0) * b1[0]",
        "(1.0 / 60.0) * push[0] - (1.0 / 7.0) * b1[0]",
        (BODY,),
    ),
    Mutation(
        "centred: equal weights folded with the wrong parity",
        CENTRED,
        "odd = x[later + c] - x[earlier + c]",
        "odd = x[later + c] + x[earlier + c]",
        (BODY,),
    ),
    Mutation(
        "centred: weights of uneven intervals",
        CENTRED,
        "weights[m, here] = 2.0 * m + 3.0",
        "weights[m, here] = 2.0 * m + 1.0",
        (BODY,),
    ),
    Mutation(
        "windows cross gaps",
        "navgrade/reconstruction/stream.py",
        "ends = k > 0 and bridged[k] != bridged[k - 1]",
        "ends = False",
        (STRETCHES,),
    ),
    Mutation(
        "sensor's end-frame increments not turned",
        "navgrade/reconstruction/compensated.py",
        "v = quat_rotate(rotvec_to_quat((dtheta[k, 0], dtheta[k, 1], dtheta[k, 2])), v)",
        "v = (v[0], v[1], v[2])",
        (BODY,),
    ),
    Mutation(
        "log: NovAtel's rates in the order roll, pitch",
        IMU_ENTRIES,
        """    name="novatel_oem7_msgs/msg/CORRIMU",
    source="NovAtel OEM7",
    gyro=("pitch_rate", "roll_rate", "yaw_rate"),""",
        """    name="novatel_oem7_msgs/msg/CORRIMU",
    source="NovAtel OEM7",
    gyro=("roll_rate", "pitch_rate", "yaw_rate"),""",
        (f"{SCHEMAS}::test_pitch_comes_before_roll[novatel]",),
    ),
    Mutation(
        "log: milliseconds of the week taken for seconds",
        IMU_ENTRIES,
        """"ms"),
    count=""",
        """"s"),
    count=""",
        (f"{SCHEMAS}::test_the_stamps_of_a_driver_are_not_those_of_the_receiver",),
    ),
    Mutation(
        "log: VectorNav in radians",
        IMU_ENTRIES,
        """    gyro_unit="deg/s",
    clock=boot_time("timestartup", "ns"),""",
        """    clock=boot_time("timestartup", "ns"),""",
        (f"{SCHEMAS}::test_delta_theta_is_in_degrees_unless_said_otherwise",),
    ),
    Mutation(
        "log: SBG's deltas taken for increments",
        IMU_ENTRIES,
        "    rates=True,",
        "    rates=False,",
        (f"{SCHEMAS}::test_deltas_that_are_rates_are_multiplied_by_their_interval",),
    ),
    Mutation(
        "log: any rate is believed",
        "navgrade/logs/imu_log.py",
        "_SAME = 0.1 ",
        "_SAME = 10.0 ",
        (f"{SCHEMAS}::test_a_rate_off_by_two_is_refused",),
    ),
    Mutation(
        "log: a device's clock taken for Unix time",
        "navgrade/logs/imu_log.py",
        "if not clock.unix:",
        "if False:",
        (f"{SCHEMAS}::test_a_clock_that_does_not_count_from_1970_is_tied_to_log_time",),
    ),
    Mutation(
        "log: the velocity of a longer interval left as it is",
        "navgrade/logs/feed.py",
        "(angle[differs] / velocity[differs])",
        "(velocity[differs] / velocity[differs])",
        (f"{SCHEMAS}::test_two_intervals_that_differ_are_made_one",),
    ),
    Mutation(
        "log: quaternion with its scalar first",
        "navgrade/logs/feed.py",
        "gyro[:, [3, 0, 1, 2]]",
        "gyro",
        (f"{SCHEMAS}::test_a_delta_quaternion_is_a_rotation_not_three_angles",),
    ),
    Mutation(
        "log: a counter turns once at most",
        "navgrade/logs/times.py",
        "self._period).astype(np.int64)",
        "self._period).clip(0, 1).astype(np.int64)",
        (f"{SCHEMAS}::test_a_counter_that_starts_again_is_unwrapped",),
    ),
    Mutation(
        "log: topics joined by their order",
        "navgrade/logs/times.py",
        "first, second = first[at_first], second[at_second]",
        "first, second = first[: len(at_first)], second[: len(at_first)]",
        (f"{SCHEMAS}::test_messages_of_two_topics_meet_by_their_stamps",),
    ),
    Mutation(
        "log: nothing waits for late messages",
        "navgrade/logs/times.py",
        "self._release(self._newest - REORDER_NS)",
        "self._release(self._newest - 5_000_000)",
        (f"{TIMES}::test_late_messages_find_their_place",),
    ),
    Mutation(
        "log: two clocks put between each other",
        "navgrade/logs/imu_log.py",
        "_CLOSE = 0.75 ",
        "_CLOSE = 0.0 ",
        (f"{TIMES}::test_a_clock_that_was_set_back_is_not_mended",),
    ),
    Mutation(
        "log: one stamp with two values",
        "navgrade/logs/times.py",
        "if differs.any():",
        "if differs.all():",
        (f"{TIMES}::test_one_stamp_with_two_values_is_refused",),
    ),
    Mutation(
        "log: INSPVAX's height taken for ellipsoidal",
        "navgrade/logs/aiding.py",
        "h = h_msl + fields[schema.undulation]",
        "h = h_msl",
        (f"{AIDING}::test_inspva_and_inspvax_mean_different_heights",),
    ),
    Mutation(
        "log: covariance along north, east, up",
        "navgrade/logs/aiding.py",
        "_sigmas(values, (4, 0, 8), kind != 0)",
        "_sigmas(values, (0, 4, 8), kind != 0)",
        (f"{AIDING}::test_nav_sat_fix",),
    ),
    Mutation(
        "log: velocity up taken for down",
        "navgrade/logs/schemas/aiding.py",
        '("up_velocity", -1.0)',
        '("up_velocity", 1.0)',
        (f"{AIDING}::test_inspva_and_inspvax_mean_different_heights",),
    ),
    Mutation(
        "pose: body axes right and down",
        PLACES,
        "_Q_FLU = (0.0, 1.0, 0.0, 0.0)",
        "_Q_FLU = (1.0, 0.0, 0.0, 0.0)",
        (f"{POSES}::test_a_steady_turn_over_one_place_has_its_rate",),
    ),
    Mutation(
        "pose: map axes south, west, up",
        PLACES,
        "_Q_ENU_NED = (0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0)",
        "_Q_ENU_NED = (0.0, np.sqrt(0.5), -np.sqrt(0.5), 0.0)",
        (f"{POSES}::test_a_level_body_that_heads_north_points_along_y_of_the_map",),
    ),
    Mutation(
        "pose: level where the map is level",
        PLACES,
        "q_mn = quat_product(q_me, to_ecef(lat[k], lon[k]))",
        "q_mn = quat_product(q_me, to_ecef(lat[0], lon[0]))",
        (f"{POSES}::test_rates_are_relative_to_the_earth_not_to_the_local_level",),
    ),
    Mutation(
        "pose: a turn in the map's axes",
        PLACES,
        "quat_product(conjugate(q_before), q)",
        "quat_product(q, conjugate(q_before))",
        (f"{POSES}::test_a_steady_turn_over_one_place_has_its_rate",),
    ),
    Mutation(
        "pose: the first interval of each block forgotten",
        PLACES,
        "last[0] = t[-1]",
        "last[0] = t[0]",
        (f"{POSES}::test_the_rate_is_the_mean_over_the_last_interval",),
    ),
    Mutation(
        "fix: velocity down taken for up",
        "navgrade/logs/solution.py",
        '"velocity_z": -down',
        '"velocity_z": down',
        (f"{POSES}::test_foxgloves_fix_has_heading_and_velocity",),
    ),
    Mutation(
        "writer: an index that points beside its message",
        WRITER,
        'entries[:, 0], entries[:, 1] = heads["log_time"], to',
        'entries[:, 0], entries[:, 1] = heads["log_time"], to + 1',
        (f"{WRITTEN}::test_every_entry_of_every_index_points_at_its_message",),
    ),
    Mutation(
        "an average called an increment",
        IMU_TOPIC,
        "dtheta * samples.dt[:, None], dvel * samples.dt[:, None]",
        "dtheta, dvel",
        (f"{CONVERTED}::test_averages_become_increments_by_their_intervals",),
    ),
    Mutation(
        "rates of a text file in body axes, called FLU",
        IMU_TOPIC,
        "samples.gyro @ to_sensor",
        "samples.gyro",
        (f"{CONVERTED}::test_rates_of_a_text_file_become_imu_messages_in_ros_axes",),
    ),
    Mutation(
        "axes of a text file turned the wrong way",
        TABLES,
        "C_bs(self.axes).T * ACCEL_UNITS",
        "C_bs(self.axes) * ACCEL_UNITS",
        (f"{READ_TABLES}::test_units_and_axes_are_turned_into_ours",),
    ),
    Mutation(
        "nanoseconds of a text file cut, not rounded",
        TABLES,
        "round(_EXACT.scaleb",
        "int(_EXACT.scaleb",
        (f"{READ_TABLES}::test_other_spellings_of_a_time",),
    ),
    Mutation(
        "epoch of a text file, sign",
        TABLES,
        "+ self.epoch_ns for text",
        "- self.epoch_ns for text",
        (f"{READ_TABLES}::test_the_epoch_is_added_to_the_nanosecond",),
    ),
    Mutation(
        "rk4: mean of the ends in the middle",
        "navgrade/reconstruction/classical.py",
        "np.array([-1.0, 9.0, 9.0, -1.0]) / 16.0",
        "np.array([0.0, 8.0, 8.0, 0.0]) / 16.0",
        ("tests/navgrade/test_flat_world.py::test_order",),
    ),
    Mutation(
        "midpoint: the force at the end not turned",
        "navgrade/reconstruction/classical.py",
        "end = quat_rotate(rotvec_to_quat(phi), f_1)",
        "end = f_1",
        ("tests/navgrade/test_flat_world.py::test_steps_are_the_lectures",),
    ),
    Mutation(
        "flat: matrix turned the other way",
        "navgrade/mechanization/flat.py",
        "row[0] - s * turn[0]",
        "row[0] + s * turn[0]",
        ("tests/navgrade/test_flat_world.py::test_quaternion_and_matrix_agree",),
    ),
    Mutation(
        "terms: another one taken out",
        "navgrade/mechanization/terms.py",
        "transport = 1.0 if kept.terms.transport_rate",
        "transport = 1.0 if kept.terms.earth_rate",
        ("tests/navgrade/test_terms.py::test_a_term_taken_out_was_never_there",),
    ),
    Mutation(
        "simulate: Coriolis sign",
        "navgrade/simulate/imu.py",
        "a_x - 2.0 * spin * v_y - g_e[0]",
        "a_x + 2.0 * spin * v_y - g_e[0]",
        ("tests/navgrade/simulate/test_segments.py::test_rates",),
    ),
    Mutation(
        "simulate: lever arm without half of Coriolis",
        "navgrade/simulate/kinematics.py",
        "x + 2.0 * y + z + w",
        "x + y + z + w",
        ("tests/navgrade/simulate/test_vibration.py::test_rates",),
    ),
    Mutation(
        "simulate: course rate on a climb",
        "navgrade/simulate/segments.py",
        "* course.rate() * np.cos(climb)",
        "* course.rate()",
        ("tests/navgrade/simulate/test_segments.py::test_rates",),
    ),
    Mutation(
        "simulate: axes of choice turned back",
        "navgrade/logs/imu_topic.py",
        "samples.accel @ to_sensor",
        "samples.accel @ to_sensor.T",
        ("tests/navgrade/simulate/test_simulation.py::test_axes_of_choice",),
    ),
    Mutation(
        "sensors: integral of a random walk",
        "navgrade/sensors/processes.py",
        "np.sqrt(12.0)",
        "np.sqrt(3.0)",
        ("tests/navgrade/sensors/test_allan.py::test_random_walk_of_the_bias",),
    ),
    Mutation(
        "sensors: plateau of a Gauss-Markov bias",
        "navgrade/sensors/processes.py",
        "np.expm1(-4.0 * u)",
        "np.expm1(-2.0 * u)",
        ("tests/navgrade/sensors/test_allan.py::test_gauss_markov_plateau",),
    ),
    Mutation(
        "compare: attitude error, sign",
        "navgrade/compare/sampling.py",
        "phi[known] = -rotvec_from_quat",
        "phi[known] = rotvec_from_quat",
        ("tests/navgrade/compare/test_sampling.py::test_difference_of_velocities_and_attitudes",),
    ),
    Mutation(
        "compare: heading errors turn the other way",
        "navgrade/compare/growth.py",
        "found[k] = east, -north",
        "found[k] = -east, north",
        ("tests/navgrade/compare/test_study.py::test_vibration_makes_coning_and_sculling_count",),
    ),
    Mutation(
        "compare: response to a tilt",
        "navgrade/compare/growth.py",
        "self.R * (1.0 - np.cos(self.schuler * s))",
        "self.R * np.sin(self.schuler * s)",
        ("tests/navgrade/compare/test_growth.py",),
    ),
    Mutation(
        "report: with truth, costs of the sensors",
        "navgrade/report/curves.py",
        "apart = apart - engine.position_error[row, :2]",
        "apart = 1.0 * apart",
        ("tests/navgrade/report/test_page.py::test_with_truth_costs_stay_those_of_the_model",),
    ),
    Mutation(
        "report: a label ends a script",
        "navgrade/report/sheet.py",
        '.replace("<", "\\\\u003c")',
        "",
        ("tests/navgrade/report/test_page.py::test_a_label_ends_no_script",),
    ),
    Mutation(
        "align: energy test takes the whole false-alarm rate",
        "align/stillness.py",
        "-scipy.special.ndtri(0.5 * false_alarm)",
        "-scipy.special.ndtri(0.05 * false_alarm)",
        ("tests/align/test_stillness.py::test_the_false_alarm_rate_is_honored_in_white_noise",),
    ),
    Mutation(
        "align: medians over the ends",
        "align/stillness.py",
        "padded = np.pad(values, ((half, half), (0, 0)), mode)",
        'padded = np.pad(values, ((half, half), (0, 0)), "edge")',
        ("tests/align/test_stillness.py::test_medians_of_fewer_rows_than_asked_for",),
    ),
    Mutation(
        "align: no guard around a slam",
        "align/stillness.py",
        "scipy.ndimage.binary_dilation(closed, np.ones(2 * guard + 1))",
        "closed",
        ("tests/align/test_stillness.py::test_disturbances_are_cut_out_and_little_else",),
    ),
    Mutation(
        "align: tilt of a swaying body, sign",
        "align/stillness.py",
        "tilt = np.cross(up, ",
        "tilt = -np.cross(up, ",
        ("tests/align/test_stillness.py",),
    ),
    Mutation(
        "align: samples belong where they begin",
        "align/spans.py",
        "t[k] - 0.5 * dt[k] - origin",
        "t[k] - dt[k] - origin",
        ("tests/align/test_spans.py",),
    ),
    Mutation(
        "align: TRIAD keeps the other vector",
        "align/triad.py",
        "return triad(axis, up, omega, f)",
        "return triad(up, axis, f, omega)",
        ("tests/align/test_triad_variants.py",),
    ),
    Mutation(
        "align: plumb line to the side, sign",
        "align/leveling.py",
        "roll += np.arctan2(along, ",
        "roll -= np.arctan2(along, ",
        ("tests/align/test_lecture_formulas.py",),
    ),
    Mutation(
        "align: small-angle gyrocompass, sign of pitch",
        "align/gyrocompass.py",
        "wx + pitch * wz",
        "wx - pitch * wz",
        ("tests/align/test_lecture_formulas.py",),
    ),
    Mutation(
        "align: QUEST at a half turn",
        "align/wahba.py",
        "axis = int(np.argmax(left))",
        "axis = 0",
        ("tests/align/test_wahba.py",),
    ),
    Mutation(
        "align: Wahba weighs by sigma, not its square",
        "align/wahba.py",
        "weight = np.min(sigmas) ** 2 / sigmas**2",
        "weight = np.min(sigmas) / sigmas",
        ("tests/align/test_wahba.py",),
    ),
    Mutation(
        "align: gravity is the same everywhere",
        "align/multi_position.py",
        "force = disturbance * self.up_n - self.g_n",
        "force = -self.g_n",
        ("tests/align/test_multi_position.py",),
    ),
    Mutation(
        "align: inertial frame, velocity of the start",
        "align/inertial_frame.py",
        "per_one = 1.0 / one[:, None, None]",
        "per_one = 0.0 / one[:, None, None]",
        ("tests/align/test_inertial_frame.py::test_swell_that_moves_the_imu_counts_in_the_sigmas",),
    ),
    Mutation(
        "align: inertial frame, drift taken back twice",
        "align/inertial_frame.py",
        "C: Array = _turns(-drift) @",
        "C: Array = _turns(drift) @",
        ("tests/align/test_inertial_frame.py::test_sway",),
    ),
    Mutation(
        "align: inertial frame, tilt and heading go together",
        "align/inertial_frame.py",
        "none - tan * ba",
        "none + tan * ba",
        ("tests/align/test_inertial_frame.py",),
    ),
    Mutation(
        "align: Kalman gain, sign",
        "align/kalman.py",
        "total -= gain[j, i] * H[j, k]",
        "total += gain[j, i] * H[j, k]",
        ("tests/align/test_kalman.py",),
    ),
    Mutation(
        "align: bounds of the innovations",
        "align/kalman.py",
        "tail = 0.5 * (1.0 - _CONFIDENCE)",
        "tail = 1.0 - _CONFIDENCE",
        ("tests/align/test_kalman.py",),
    ),
    Mutation(
        "align: fine, gravity and tilt",
        "align/fine.py",
        "F[:, _V, _A] = skew(model.gravity_n)",
        "F[:, _V, _A] = -skew(model.gravity_n)",
        ("tests/align/test_fine.py::test_unobservable_biases_tilt_and_turn_by_the_signed_laws",),
    ),
    Mutation(
        "align: fine, disturbed spans count twice",
        "align/fine.py",
        "rate[~rows.still] = 0.0",
        "rate[~rows.still] *= 1.0",
        ("tests/align/test_fine.py",),
    ),
    Mutation(
        "survey: Laplace, sign",
        "align/survey/azimuths.py",
        "turn = -eta * np.tan(lat)",
        "turn = eta * np.tan(lat)",
        ("tests/align/test_azimuths.py",),
    ),
    Mutation(
        "survey: sigmas across a line",
        "align/survey/azimuths.py",
        "np.hypot(mark.sigmas[0] * np.sin(azimuth), mark.sigmas[1] * np.cos(azimuth))",
        "np.hypot(mark.sigmas[1] * np.sin(azimuth), mark.sigmas[0] * np.cos(azimuth))",
        ("tests/align/test_azimuths.py",),
    ),
    Mutation(
        "survey: geoid height, sign",
        "align/survey/marks.py",
        "return above_sea + geoid_height",
        "return above_sea - geoid_height",
        ("tests/align/test_marks.py",),
    ),
    Mutation(
        "survey: SINEX years of two digits",
        "align/survey/sinex.py",
        "year += 2000 if year <= 50 else 1900",
        "year += 2000",
        ("tests/align/test_marks.py",),
    ),
    Mutation(
        "survey: GeoJSON height of unknown kind",
        "align/survey/geojson.py",
        'values["unsaid_height"] = coordinates[2]',
        'values["height"] = coordinates[2]',
        ("tests/align/test_marks.py",),
    ),
    Mutation(
        "align: east accelerometers tilt and turn",
        "align/accuracy.py",
        "P_n[0, 2] = P_n[2, 0] = -np.tan(lat) * tilt**2",
        "P_n[0, 2] = P_n[2, 0] = np.tan(lat) * tilt**2",
        ("tests/align/test_methods.py::test_a_gyrocompass_tilts_and_turns_together",),
    ),
    Mutation(
        "align: given heading, tilt turns about down",
        "align/accuracy.py",
        "P_n[2, :2] = P_n[:2, 2] = -across * tilt**2",
        "P_n[2, :2] = P_n[:2, 2] = across * tilt**2",
        ("tests/align/test_methods.py",),
    ),
    Mutation(
        "align: stated noise counts whatever the data show",
        "align/window.py",
        "return Noise(shown if exceeds else float(stated), bool(exceeds))",
        "return Noise(float(stated), False)",
        ("tests/align/test_methods.py",),
    ),
    Mutation(
        "align: hemisphere passes",
        "align/checks.py",
        "if abs(implied + lat) < near:",
        "if abs(implied + 2.0 * lat) < near:",
        ("tests/navgrade/cli/test_align_methods.py::test_a_wrong_place_is_named",),
    ),
    Mutation(
        "align: a sway goes to TRIAD",
        "navgrade/alignment.py",
        '(sways and method == "auto")',
        '(sways and method == "autos")',
        ("tests/navgrade/cli/test_align_methods.py::test_a_swaying_base_is_never_given_to_triad",),
    ),
    Mutation(
        "align: slams are averaged in",
        "navgrade/alignment.py",
        "means = _means(part.spans[rows])",
        "means = _means(part.spans)",
        ("tests/navgrade/cli/test_align_methods.py::test_door_slams_are_cut_out",),
    ),
    Mutation(
        "site: lever arm turned the other way",
        "navgrade/site.py",
        "dcm_from_quat(q_nb) @ np.array(place.lever_arm_b)",
        "dcm_from_quat(q_nb).T @ np.array(place.lever_arm_b)",
        ("tests/navgrade/test_site.py",),
    ),
    Mutation(
        "report: share of a budget",
        "navgrade/report/alignment.py",
        "share = 100.0 * (part / whole) ** 2",
        "share = 100.0 * (part / whole)",
        ("tests/navgrade/report/test_alignment_page.py",),
    ),
)


def is_red(mutation: Mutation, *options: str) -> bool:
    """Apply a mutation to a copy of the repository and return whether its tests fail."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for part in PARTS:
            source = ROOT / part
            if source.is_dir():
                ignore = shutil.ignore_patterns("__pycache__", "node_modules")
                shutil.copytree(source, folder / part, ignore=ignore)
            else:
                shutil.copy(source, folder / part)
        target = folder / mutation.file
        text = target.read_text()
        if text.count(mutation.old) != 1:
            raise SystemExit(f"{mutation.name}: its text stands {text.count(mutation.old)} times")
        target.write_text(text.replace(mutation.old, mutation.new))
        environment = {
            **os.environ,
            "PYTHONPATH": str(folder),
            "NUMBA_CACHE_DIR": str(folder / "cache"),
        }
        # no diffs of what differs: those of long bytes take minutes
        quick = ("-x", "-q", "--assert=plain", "-p", "no:cacheprovider")
        command = [sys.executable, "-m", "pytest", *quick, *options]
        done = subprocess.run(
            [*command, *mutation.tests], cwd=folder, env=environment, capture_output=True, text=True
        )
    if done.returncode not in (0, 1):  # 1: tests ran and failed
        raise SystemExit(f"{mutation.name}: pytest ended with {done.returncode}\n{done.stdout}")
    return done.returncode == 1


def main() -> None:
    """Try the mutations chosen on the command line, and report."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutations")
    parser.add_argument("words", nargs="*", help="only those whose names hold these words")
    parser.add_argument("--share", type=int, default=1, metavar="K", help="every K-th")
    parser.add_argument("--turn", type=int, default=0, metavar="N", help="start with the N-th")
    given = parser.parse_args()
    chosen = [m for m in MUTATIONS if all(word in m.name for word in given.words)]
    chosen = chosen[given.turn % given.share :: given.share]
    if not chosen:
        raise SystemExit("no mutation has such a name")
    tests = tuple(sorted({test for mutation in chosen for test in mutation.tests}))
    untouched = Mutation("no mutation", NED, "class Ned(", "class Ned(", tests)
    if is_red(untouched, "-n", "auto"):
        raise SystemExit("the tests fail without any mutation")
    survived = []
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for mutation, caught in zip(chosen, pool.map(is_red, chosen), strict=True):
            print(f"{'red' if caught else 'SURVIVED':<9}{mutation.name}", flush=True)
            if not caught:
                survived.append(mutation.name)
    if survived:
        raise SystemExit(f"{len(survived)} of {len(chosen)} mutations survived")
    print(f"all {len(chosen)} mutations turned a test red")


if __name__ == "__main__":
    main()
