"""IMU samples, and the members of any topic, from one kind of file to another."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from navgrade.errors import ConfigError, LogError
from navgrade.imu import ImuSamples
from navgrade.logs.appearing import appearing
from navgrade.logs.container import McapFile
from navgrade.logs.container.writer import McapWriter
from navgrade.logs.imu_log import ImuLog
from navgrade.logs.imu_topic import INCREMENTS, RATES, ImuTopic, stamps_ns
from navgrade.logs.outgoing import Columns
from navgrade.logs.tables import SampleTable

CONVERSION = "navgrade.conversion"
_BLOCK = 65_536  # samples turned into messages at a time
Progress = Callable[[int], None]


@dataclass(frozen=True)
class Converted:
    """How many samples were written, and as what, in words."""

    count: int
    what: str


def convert_imu(
    imu: ImuLog | SampleTable,
    output: Path,
    *,
    start: float | None = None,
    end: float | None = None,
    progress: Progress | None = None,
    overwrite: bool = False,
) -> Converted:
    """Write IMU samples as messages (``.mcap``) or as a table (``.csv``, ``.parquet``).

    Messages are ``navgrade_msgs/msg/ImuIncrement`` in body axes; those of a log's averages hold
    the average times its interval, which is exact. An instantaneous rate is no increment: what
    happens between two of them is for the reconstruction to choose when it navigates, not for the
    data. The rates of a text file become ``sensor_msgs/msg/Imu`` in its own axes, FLU. Kind and
    axes stand in the metadata of the channel, where `open_imu` finds them.

    A table holds body axes, the unit in each column's name.

    Parameters
    ----------
    imu : ImuLog or SampleTable
    output : Path
        Appears when it is complete.
    start, end : float, optional
        s after the first sample; from `start` on and before `end`.
    progress : callable, optional
        Called with the number of bytes of the input read so far.
    overwrite : bool

    Raises
    ------
    LogError
        When the samples cannot be used, or none lies between `start` and `end`.
    ConfigError
        When a log's instantaneous rates should become increments, the suffix is not known,
        pyarrow is missing for Parquet, or `output` must not be written.
    """
    if output.suffix not in (".mcap", *_TABLES):
        raise ConfigError(f"the output {output} does not end in .mcap, {' or '.join(_TABLES)}")
    blocks = _between(imu, start, end, progress)
    if output.suffix != ".mcap":
        count = write_table(output, map(_sample_columns, blocks), overwrite=overwrite)
        return Converted(count, f"kind {imu.kind}, axes FRD")
    is_rate = imu.kind in ("rate", "average")
    form = RATES if is_rate and isinstance(imu, SampleTable) else INCREMENTS
    kind = "increment" if is_rate and form is INCREMENTS else imu.kind
    if form is INCREMENTS and imu.kind == "rate":
        raise ConfigError(
            "instantaneous rates are not increments, a reconstruction makes them when it "
            "navigates; say --kind average if these are means over the interval, as most drivers "
            "publish, or write a table"
        )
    count = 0
    with McapWriter(output, overwrite=overwrite) as out:
        out.add_metadata(CONVERSION, _origin(imu))
        topic = ImuTopic(out, form, kind)
        for samples in blocks:
            out.write(topic.batch(samples))
            count += len(samples)
    return Converted(count, f"{form.topic}, {form.schema.name}, kind {kind}, axes {form.axes}")


def write_increments(
    path: str | Path,
    imu: ImuSamples,
    *,
    topic: str = INCREMENTS.topic,
    frame_id: str = "imu",
    overwrite: bool = False,
) -> None:
    """Write increments in body axes as ``navgrade_msgs/msg/ImuIncrement``.

    Parameters
    ----------
    path : path
    imu : ImuSamples
        Of kind ``increment`` or ``compensated``.
    topic, frame_id : str
    overwrite : bool

    Raises
    ------
    ValueError
        If `imu` holds rates.
    LogError
        If the samples span more than a million seconds, which hide their nanoseconds.
    ConfigError
        If `path` exists and must not be overwritten.
    """
    if not imu.is_integrated:
        raise ValueError(f"ImuIncrement holds increments, not kind {imu.kind!r}")
    with McapWriter(path, overwrite=overwrite) as out:
        increments = ImuTopic(out, INCREMENTS, imu.kind, topic=topic, frame_id=frame_id)
        for samples in imu.blocks(_BLOCK):
            out.write(increments.batch(samples))


def _between(
    imu: ImuLog | SampleTable, start: float | None, end: float | None, progress: Progress | None
) -> Iterator[ImuSamples]:
    found = False
    for block in imu.blocks(progress):
        first = 0 if start is None else int(np.searchsorted(block.t, start))
        stop = len(block) if end is None else int(np.searchsorted(block.t, end))
        if stop > first:
            found = True
            yield block[first:stop]
        if stop < len(block):
            break
    if not found:
        until = "" if end is None else f" and before {end:g} s"
        text = f"there is no sample from {start or 0.0:g} s on{until}"
        raise LogError(text, file=str(imu.path))


def _origin(imu: ImuLog | SampleTable) -> dict[str, str]:
    """Where samples come from and how they were understood."""
    topic = {"input_topic": imu.topic} if isinstance(imu, ImuLog) else {}
    return {
        "version": version("navgrade"),
        "input": Path(imu.path).name,
        **topic,
        "kind": imu.kind,
        "axes": imu.axes,
        "gyro_unit": imu.gyro_unit,
        "accel_unit": imu.accel_unit,
    }


def _sample_columns(samples: ImuSamples) -> dict[str, NDArray[Any]]:
    """Samples in body axes as columns that say their unit."""
    names = "gyro_{}_rad_s", "accel_{}_m_s2"
    if samples.is_integrated:
        names = "delta_angle_{}_rad", "delta_velocity_{}_m_s"
    columns = {"time_ns": stamps_ns(samples), "time_s": samples.t, "interval_s": samples.dt}
    for name, values in zip(names, (samples.gyro, samples.accel), strict=True):
        columns |= {name.format(axis): values[:, i] for i, axis in enumerate("xyz")}
    return columns


def topic_columns(
    log: McapFile,
    topic: str,
    *,
    start: float | None = None,
    end: float | None = None,
    progress: Progress | None = None,
) -> Iterator[Columns]:
    """Yield the members of a topic's messages, named as in its definition.

    Sequences are left out: their length may change.

    Parameters
    ----------
    log : McapFile
        Its topics known, see `navgrade.logs.topics.open_known`.
    topic : str
    start, end : float, optional
        s of log time after the topic's first message; from `start` on and before `end`.
    progress : callable, optional
        Called with the number of bytes of the log read so far.

    Raises
    ------
    LogError, SchemaError
        When there is no such topic, no message of it, or its definition is not understood.
    """
    paths = _paths(log, topic)
    first_ns = None
    found = False
    for read in log.columns({topic: list(paths)}, progress=progress):
        first_ns = int(read.log_time_ns[0]) if first_ns is None else first_ns
        t = (read.log_time_ns - first_ns) * 1e-9
        keep = (t >= (0.0 if start is None else start)) & (t < (np.inf if end is None else end))
        if not keep.any():
            continue
        found = True
        columns = {"log_time_ns": read.log_time_ns[keep]}
        for path, name in paths.items():
            values = read.fields[path][keep]
            if values.ndim == 1:
                columns[name] = values
            else:
                columns |= {f"{name}.{i}": values[:, i] for i in range(values.shape[1])}
        yield columns
    if not found:
        raise LogError("no message of it is there", file=log.name, topic=topic)


def _paths(log: McapFile, topic: str) -> dict[str, str]:
    """What to read of a topic's messages, and the columns' names; a time is one column, ns."""
    leaves = [m.path for m in log.members(topic) if "#" not in m.path and m.count != 0]
    names = {}
    for path in leaves:
        parent, _, name = path.rpartition(".")
        if parent and name in ("sec", "nanosec") and f"{parent}.nanosec" in leaves:
            names[parent] = f"{parent}_ns"
        else:
            names[path] = path
    return names


def write_table(path: Path, blocks: Iterable[Columns], *, overwrite: bool = False) -> int:
    """Write columns as CSV or Parquet, by the suffix; the file appears when it is complete.

    Returns
    -------
    int
        Rows written.

    Raises
    ------
    ConfigError
        On another suffix, when pyarrow is missing for Parquet, or `path` must not be written.
    """
    if path.suffix not in _TABLES:
        raise ConfigError(f"the output {path} does not end in {' or '.join(_TABLES)}")
    write = _TABLES[path.suffix]
    with appearing(path, overwrite=overwrite) as stream:
        return write(stream, blocks)


def _write_csv(stream: BinaryIO, blocks: Iterable[Columns]) -> int:
    text = io.TextIOWrapper(stream, encoding="utf-8", newline="")
    writer = csv.writer(text, lineterminator="\n")
    rows = 0
    for columns in blocks:
        if not rows:
            writer.writerow(columns)
        cells = [column.tolist() for column in columns.values()]
        writer.writerows(zip(*cells, strict=True))
        rows += len(cells[0])
    text.flush()
    text.detach()
    return rows


def _write_parquet(stream: BinaryIO, blocks: Iterable[Columns]) -> int:
    try:
        import pyarrow
        from pyarrow.parquet import ParquetWriter
    except ImportError:
        raise ConfigError(
            "Parquet needs pyarrow, pip install 'navgrade[parquet]'; or write .csv"
        ) from None
    rows = 0
    with ExitStack() as stack:
        for columns in blocks:
            table = pyarrow.table(dict(columns))
            if not rows:
                writer = stack.enter_context(ParquetWriter(stream, table.schema))
            writer.write_table(table)
            rows += len(table)
    return rows


_TABLES: dict[str, Callable[[BinaryIO, Iterable[Columns]], int]] = {
    ".csv": _write_csv,
    ".parquet": _write_parquet,
}
