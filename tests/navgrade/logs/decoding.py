"""Solutions as other people's software decodes them."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader

Columns = dict[str, NDArray[Any]]

SOLUTION = "/navgrade/solution"
FIX = "/navgrade/fix"
SOLUTION_FLOATS = (
    "latitude_deg",
    "longitude_deg",
    "height_m",
    "v_north_m_s",
    "v_east_m_s",
    "v_down_m_s",
    "roll_deg",
    "pitch_deg",
    "heading_deg",
    "orientation.w",
    "orientation.x",
    "orientation.y",
    "orientation.z",
)
FIX_FLOATS = ("latitude", "longitude", "altitude")
ODOMETRY = "/navgrade/odometry"
TRANSFORMS = "/tf"
LOCATION = "/navgrade/location"
ODOMETRY_FLOATS = tuple(
    f"{path}.{axis}"
    for path, axes in (
        ("pose.pose.position", "xyz"),
        ("pose.pose.orientation", "xyzw"),
        ("twist.twist.linear", "xyz"),
        ("twist.twist.angular", "xyz"),
    )
    for axis in axes
)
NODE_FOLDER = Path(__file__).resolve().parents[2] / "node"


def _member(message: Any, path: str) -> Any:
    """A member by its dotted path, elements of sequences by their number."""
    for name in path.split("."):
        message = message[int(name)] if name.isdigit() else getattr(message, name)
    return message


def messages_by_mcap_ros2_support(path: Path, topic: str) -> list[Any]:
    """Decode with the official reader, every checksum verified."""
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        return [row.decoded_message for row in reader.iter_decoded_messages(topics=[topic])]


def messages_by_rosbags(path: Path, topic: str) -> list[Any]:
    """Decode with rosbags; its types are those the file itself describes."""
    with AnyReader([path]) as reader:
        wanted = [connection for connection in reader.connections if connection.topic == topic]
        return [
            reader.deserialize(raw, connection.msgtype)
            for connection, _, raw in reader.messages(connections=wanted)
        ]


MESSAGES: dict[str, Callable[[Path, str], list[Any]]] = {
    "mcap-ros2-support": messages_by_mcap_ros2_support,
    "rosbags": messages_by_rosbags,
}


def _decoded(
    read: Callable[[Path, str], list[Any]],
    path: Path,
    topic: str,
    floats: Sequence[str],
    integers: Sequence[str],
    stamp: str = "header.stamp",
) -> Columns:
    """Columns of a topic, and its stamps."""
    messages = read(path, topic)
    columns: Columns = {}
    for name in floats:
        values = [_member(message, name) for message in messages]
        assert all(type(value) is float for value in values)
        columns[name] = np.array(values)
    seconds, nanoseconds = f"{stamp}.sec", f"{stamp}.nanosec"
    for name in (seconds, nanoseconds, *integers):
        columns[name] = np.array([_member(message, name) for message in messages], np.int64)
    columns["stamp_ns"] = columns[seconds] * 1_000_000_000 + columns[nanoseconds]
    return columns


Decoder = Callable[..., Columns]
by_mcap_ros2_support: Decoder = partial(_decoded, messages_by_mcap_ros2_support)
by_rosbags: Decoder = partial(_decoded, messages_by_rosbags)
DECODERS: dict[str, Decoder] = {
    "mcap-ros2-support": by_mcap_ros2_support,
    "rosbags": by_rosbags,
}


def solution(path: Path, decoder: Decoder = by_mcap_ros2_support) -> Columns:
    """Columns of the solution."""
    return decoder(path, SOLUTION, SOLUTION_FLOATS, ["status"])


def fixes(path: Path, decoder: Decoder = by_mcap_ros2_support) -> Columns:
    """Columns of the fixes."""
    return decoder(path, FIX, FIX_FLOATS, ["status.status", "status.service"])


def by_node(path: Path, topic: str, count: int) -> dict[str, Any]:
    """First and last `count` messages, floats as hexadecimal bits; skip where Node is not."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("Node.js is not installed")
    if not (NODE_FOLDER / "node_modules").is_dir():
        pytest.skip("the JavaScript libraries are not installed: run `npm ci` in tests/node")
    done = subprocess.run(
        [node, "read_solution.mjs", str(path.resolve()), topic, str(count)],
        cwd=NODE_FOLDER,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer
