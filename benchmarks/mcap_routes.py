"""Ways of reading and writing a log of Imu messages, each in a process of its own.

``python -m benchmarks.mcap_routes ROUTE PATH MESSAGES RUNS`` prints what the route cost as JSON.
"""

from __future__ import annotations

import json
import os
import struct
import sys
import time
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import BufferedWriter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.navgrade.logmaking import EPOCH_NS, IMU, IMU_TEXT

Work = Callable[[], int]

TOPIC = "/imu/data"
STEP_NS = 2_500_000  # 400 Hz
FIELDS = ("header.stamp", "angular_velocity", "linear_acceleration")
SLAB = 65_536  # messages made or handed over at once
CHUNK_BYTES = 1 << 20
# CDR of sensor_msgs/msg/Imu with the frame_id "imu_link", filled up to the next multiple of 8
MESSAGE = np.dtype(
    [
        ("encapsulation", "u1", 4),
        ("sec", "<i4"),
        ("nanosec", "<u4"),
        ("frame_id_length", "<u4"),
        ("frame_id", "S12"),
        ("orientation", "<f8", 4),
        ("orientation_covariance", "<f8", 9),
        ("angular_velocity", "<f8", 3),
        ("angular_velocity_covariance", "<f8", 9),
        ("linear_acceleration", "<f8", 3),
        ("linear_acceleration_covariance", "<f8", 9),
    ]
)
RECORD = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
        ("message", MESSAGE),
    ]
)
_CHUNK_HEAD = struct.Struct("<BQQQQII4sQ")  # up to the records, compression "zstd"


@dataclass(frozen=True)
class Imu:
    """Columns of a log: stamps (ns), angular rates (rad/s), specific forces (m/s²)."""

    stamp_ns: NDArray[np.int64]
    gyro: NDArray[np.float64]
    accel: NDArray[np.float64]

    def slabs(self) -> Iterator[Imu]:
        """Yield the rows in slabs."""
        for first in range(0, len(self.stamp_ns), SLAB):
            rows = slice(first, first + SLAB)
            yield Imu(self.stamp_ns[rows], self.gyro[rows], self.accel[rows])


def noisy(first: int, count: int) -> Imu:
    """Messages `first`, `first` + 1, … of an IMU at rest; the noise is all that needs space."""
    noise = np.random.default_rng(first).standard_normal((2, count, 3))
    stamp_ns = EPOCH_NS + STEP_NS * np.arange(first, first + count)
    return Imu(stamp_ns, 2e-3 * noise[0], 1e-2 * noise[1] + np.array([0.0, 0.0, 9.81]))


def blank(count: int) -> NDArray[np.void]:
    """Messages with all that stays the same in a recording."""
    rows = np.zeros(count, MESSAGE)
    rows["encapsulation"] = 0, 1, 0, 0
    rows["frame_id_length"] = 9
    rows["frame_id"] = b"imu_link"
    rows["orientation"] = 0.0, 0.0, 0.0, 1.0
    rows["orientation_covariance"] = 1e-4 * np.eye(3).ravel()
    rows["angular_velocity_covariance"] = 4e-6 * np.eye(3).ravel()
    rows["linear_acceleration_covariance"] = 1e-4 * np.eye(3).ravel()
    return rows


def fill(rows: NDArray[np.void], imu: Imu) -> NDArray[np.uint8]:
    """Put columns into as many of the blank messages; their bytes, of shape (n, size)."""
    rows = rows[: len(imu.stamp_ns)]
    rows["sec"], rows["nanosec"] = np.divmod(imu.stamp_ns, 1_000_000_000)
    rows["angular_velocity"] = imu.gyro
    rows["linear_acceleration"] = imu.accel
    return rows.view(np.uint8).reshape(len(rows), MESSAGE.itemsize)


def _synced(stream: BufferedWriter) -> None:
    """Every writer's file is brought to the disk within its time."""
    stream.flush()
    os.fsync(stream.fileno())


def write_official(path: Path, slabs: Iterator[Imu]) -> int:
    """Write messages, packed by hand, with the official library and its defaults."""
    rows = blank(SLAB)
    return _write_official(path, ((s.stamp_ns.tolist(), fill(rows, s).tobytes()) for s in slabs))


def _write_official(path: Path, slabs: Iterator[tuple[list[int], bytes]]) -> int:
    from mcap.writer import Writer

    sequence, size = 0, MESSAGE.itemsize
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2", library="benchmarks")
        schema = writer.register_schema(IMU, "ros2msg", IMU_TEXT.encode())
        channel = writer.register_channel(TOPIC, "cdr", schema)
        for times, data in slabs:
            for k, time_ns in enumerate(times):
                message = data[k * size : (k + 1) * size]
                writer.add_message(channel, time_ns, message, time_ns, sequence)
                sequence += 1
        writer.finish()
        _synced(stream)
    return sequence


def write_ours(path: Path, slabs: Iterator[Imu], threads: int = 2) -> int:
    """Write messages with this project's writer."""
    from navgrade.logs.container.writer import Batch, McapWriter
    from navgrade.logs.messages import Schema

    rows, done = blank(SLAB), 0
    with McapWriter(path, overwrite=True, threads=threads) as writer:
        channel = writer.add_channel(TOPIC, Schema(IMU, IMU_TEXT))
        for slab in slabs:
            writer.write(Batch(channel, slab.stamp_ns, fill(rows, slab)))
            done += len(slab.stamp_ns)
    return done


def _read_floor(crc: bool) -> Callable[[Path, int], Work]:
    """Chunks read, decompressed (and checked) through two buffers that are kept."""

    def prepare(path: Path, count: int) -> Work:
        import zstandard
        from mcap.reader import make_reader

        with path.open("rb") as stream:
            summary = make_reader(stream).get_summary()
        assert summary is not None
        chunks = summary.chunk_indexes
        stored = memoryview(bytearray(max(chunk.chunk_length for chunk in chunks)))
        records = memoryview(bytearray(max(chunk.uncompressed_size for chunk in chunks)))
        decompressor = zstandard.ZstdDecompressor()

        def run() -> int:
            with path.open("rb", buffering=0) as stream:
                for chunk in chunks:
                    stream.seek(chunk.chunk_start_offset)
                    stream.readinto(stored[: chunk.chunk_length])
                    told = _CHUNK_HEAD.unpack_from(stored)
                    part = records[: chunk.uncompressed_size]
                    frame = stored[_CHUNK_HEAD.size : chunk.chunk_length]
                    with decompressor.stream_reader(frame) as out:
                        assert out.readinto(part) == chunk.uncompressed_size
                    if crc:
                        assert zlib.crc32(part) == told[5]
            return count

        return run

    return prepare


def _read_ours(threads: int) -> Callable[[Path, int], Work]:
    def prepare(path: Path, count: int) -> Work:
        from navgrade.logs.container import McapFile

        def run() -> int:
            blocks = McapFile(path).columns({TOPIC: FIELDS}, threads=threads)
            return sum(len(block) for block in blocks)

        return run

    return prepare


def _read_ours_whole(path: Path, count: int) -> Work:
    from navgrade.logs.container import McapFile

    def run() -> int:
        log_time_ns = np.empty(count, np.int64)
        stamp_ns = np.empty(count, np.int64)
        gyro, accel = np.empty((2, count, 3))
        done = 0
        for block in McapFile(path).columns({TOPIC: FIELDS}, threads=1):
            rows = slice(done, done + len(block))
            log_time_ns[rows] = block.log_time_ns
            stamp_ns[rows], gyro[rows], accel[rows] = (block.fields[name] for name in FIELDS)
            done = rows.stop
        return done

    return run


def _read_official_raw(log_time_order: bool) -> Callable[[Path, int], Work]:
    def prepare(path: Path, count: int) -> Work:
        from mcap.reader import make_reader

        def run() -> int:
            with path.open("rb") as stream:
                found = make_reader(stream).iter_messages(TOPIC, log_time_order=log_time_order)
                return sum(1 for _ in found)

        return run

    return prepare


def _take(message: Any) -> None:
    """Look at what is wanted of a decoded message, and keep nothing."""
    stamp, gyro, accel = message.header.stamp, message.angular_velocity, message.linear_acceleration
    _ = stamp.sec, stamp.nanosec, gyro.x, gyro.y, gyro.z, accel.x, accel.y, accel.z


def _read_documented(path: Path, count: int) -> Work:
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    def run() -> int:
        done = 0
        with path.open("rb") as stream:
            reader = make_reader(stream, decoder_factories=[DecoderFactory()])
            for *_, message in reader.iter_decoded_messages(TOPIC, log_time_order=False):
                _take(message)
                done += 1
        return done

    return run


def _read_rosbags(path: Path, count: int) -> Work:
    from rosbags.highlevel import AnyReader

    def run() -> int:
        done = 0
        with AnyReader([path]) as reader:
            for connection, _, data in reader.messages():
                _take(reader.deserialize(data, connection.msgtype))
                done += 1
        return done

    return run


def _read_rerun(path: Path, count: int) -> Work:
    from rerun.chunk import McapReader

    def run() -> int:
        reader = McapReader(path, decoders=["raw"], include_topic_regex=[TOPIC])
        return sum(chunk.num_rows for chunk in reader.stream())

    return run


def _write_floor(path: Path, count: int) -> Work:
    import zstandard

    imu = noisy(0, count)
    records = np.zeros(count, RECORD)
    records["opcode"], records["length"] = 5, RECORD.itemsize - 9
    records["sequence"] = np.arange(count)
    records["log_time"] = records["publish_time"] = imu.stamp_ns
    for slab, part in zip(imu.slabs(), np.split(records, range(SLAB, count, SLAB)), strict=True):
        rows = blank(len(part))
        fill(rows, slab)
        part["message"] = rows
    data = records.data.cast("B")

    def run() -> int:
        compressor = zstandard.ZstdCompressor(level=1)
        with path.open("wb") as stream:
            for start in range(0, len(data), CHUNK_BYTES):
                part = data[start : start + CHUNK_BYTES]
                stream.write(struct.pack("<I", zlib.crc32(part)))
                stream.write(compressor.compress(part))
            _synced(stream)
        return len(data) // RECORD.itemsize

    return run


def _write_ours(threads: int) -> Callable[[Path, int], Work]:
    def prepare(path: Path, count: int) -> Work:
        import navgrade.logs.container.writer  # noqa: F401  not in the time

        imu = noisy(0, count)
        return lambda: write_ours(path, imu.slabs(), threads)

    return prepare


def _write_ready(path: Path, count: int) -> Work:
    rows = blank(SLAB)
    ready = [(s.stamp_ns.tolist(), fill(rows, s).tobytes()) for s in noisy(0, count).slabs()]
    return lambda: _write_official(path, iter(ready))


def _write_documented(path: Path, count: int) -> Work:
    from mcap_ros2.writer import Writer

    def vector(values: NDArray[np.float64]) -> dict[str, float]:
        return dict(zip("xyz", values.tolist(), strict=True))

    imu, covariance = noisy(0, count), (1e-4 * np.eye(3)).ravel().tolist()
    messages = []
    for stamp_ns, gyro, accel in zip(imu.stamp_ns.tolist(), imu.gyro, imu.accel, strict=True):
        sec, nanosec = divmod(stamp_ns, 1_000_000_000)
        message = {
            "header": {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": "imu_link"},
            "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
            "orientation_covariance": covariance,
            "angular_velocity": vector(gyro),
            "angular_velocity_covariance": covariance,
            "linear_acceleration": vector(accel),
            "linear_acceleration_covariance": covariance,
        }
        messages.append((stamp_ns, message))

    def run() -> int:
        with path.open("wb") as stream:
            writer = Writer(stream)
            schema = writer.register_msgdef(IMU, IMU_TEXT)
            for sequence, (stamp_ns, message) in enumerate(messages):
                writer.write_message(TOPIC, schema, message, stamp_ns, stamp_ns, sequence)
            writer.finish()
            _synced(stream)
        return len(messages)

    return run


@dataclass(frozen=True)
class Route:
    """One way of doing the job.

    Attributes
    ----------
    label : str
    prepare : callable
        Of a path and a number of messages: imports, makes arrays, and returns the work.
    package : str
        What it needs beyond this project, as imported.
    share : float
        Part of the messages it is given.
    slow : bool
        Run once.
    """

    label: str
    prepare: Callable[[Path, int], Work]
    package: str = "mcap"
    share: float = 1.0
    slow: bool = False


READ_FLOOR, READ_OURS, READ_PEER = "read floor + CRC", "read ours", "read documented"
READERS = {
    "read floor": Route("floor: decompress", _read_floor(crc=False)),
    READ_FLOOR: Route("floor + CRC", _read_floor(crc=True)),
    READ_OURS: Route("**navgrade, streamed, 1 thread**", _read_ours(1)),
    "read ours 2": Route("**navgrade, streamed, 2 threads**", _read_ours(2)),
    "read ours whole": Route("**navgrade, whole arrays, 1 thread**", _read_ours_whole),
    "read rerun": Route("rerun-sdk, raw bytes", _read_rerun, "rerun"),
    "read raw": Route("mcap, raw bytes, log-time order", _read_official_raw(True), slow=True),
    "read raw file": Route("mcap, raw bytes, file order", _read_official_raw(False), slow=True),
    "read rosbags": Route("rosbags, decoded", _read_rosbags, "rosbags", slow=True),
    READ_PEER: Route(
        "mcap + mcap-ros2-support, decoded, file order", _read_documented, "mcap_ros2", slow=True
    ),
}
WRITE_FLOOR, WRITE_OURS, WRITE_PEER = "write floor", "write ours", "write documented"
WRITERS = {
    WRITE_FLOOR: Route("floor: CRC, zstd level 1 and write of ready bytes", _write_floor),
    WRITE_OURS: Route("**navgrade, from arrays, 1 thread**", _write_ours(1)),
    "write two": Route("**navgrade, from arrays, 2 threads**", _write_ours(2)),
    "write ready": Route("mcap, ready bytes", _write_ready, slow=True),
    WRITE_PEER: Route(
        "mcap-ros2-support, ready dictionaries (a tenth of them)",
        _write_documented,
        "mcap_ros2",
        share=0.1,
        slow=True,
    ),
}


def memory_mb(kind: str) -> float:
    """Memory of this process: ``VmRSS`` now, or ``VmHWM``, the largest so far."""
    status = Path("/proc/self/status").read_text()
    return int(status.split(f"{kind}:")[1].split()[0]) / 1024


def main() -> None:
    """Run one route and print its cost."""
    name, path, count, runs = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
    work = (READERS | WRITERS)[name].prepare(path, count)
    before = memory_mb("VmRSS")
    Path("/proc/self/clear_refs").write_text("5")  # largest memory from here on
    wall, cpu = [], []
    for _ in range(runs):
        began, used = time.perf_counter(), time.process_time()
        handled = work()
        wall.append(time.perf_counter() - began)
        cpu.append(time.process_time() - used)
        assert handled == count, f"{name}: {handled} of {count} messages"
    peak = memory_mb("VmHWM")
    print(json.dumps({"wall": wall, "cpu": cpu, "peak": peak, "before": before}))


if __name__ == "__main__":
    main()
