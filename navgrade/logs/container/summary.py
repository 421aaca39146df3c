"""The index at the end of a file, believed only when its checksum agrees."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Callable
from typing import Any, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import (
    AttachmentIndex,
    Channel,
    ChunkIndex,
    MetadataIndex,
    Schema,
    Statistics,
)
from mcap.summary import Summary

from navgrade.logs.container.chunks import RECORD
from navgrade.logs.container.source import Source, read_at

MAGIC = b"\x89MCAP0\r\n"
PARSE_ERRORS = (ValueError, struct.error, McapError, MemoryError, OverflowError)
_FOOTER = struct.Struct("<BQQQI")
_MAX_SUMMARY = 1 << 30
_INDEX_HEAD = struct.Struct("<QQQQI")
_INDEX_ENTRY = struct.Struct("<HQ")
_SIZES = struct.Struct("<QQ")


class Ending(NamedTuple):
    """What stands behind the data: the summary, None where there is none or it is `wrong`."""

    summary: Summary | None = None
    wrong: str | None = None
    data_end: int | None = None  # where the data end, None where nothing sound says so


def read_summary(source: Source) -> Ending:
    """Read the footer and the summary it points to."""
    tail_size = _FOOTER.size + len(MAGIC)
    tail = read_at(source, max(0, source.size - tail_size), tail_size)
    if len(tail) < tail_size or not tail.endswith(MAGIC):
        return Ending()  # the file is cut: said where its end is met
    opcode, length, start, _, crc = _FOOTER.unpack_from(tail)
    end = source.size - tail_size
    if opcode != Opcode.FOOTER or length != _FOOTER.size - RECORD.size:
        return Ending(wrong="the footer is damaged")
    start = start or end
    if not len(MAGIC) <= start <= end or end - start > _MAX_SUMMARY:
        return Ending(wrong="the footer points outside the file")
    records = read_at(source, start, end - start)
    if crc and zlib.crc32(tail[: _FOOTER.size - 4], zlib.crc32(records)) != crc:
        return Ending(wrong="its checksum does not match")
    if not records:
        return Ending(data_end=start)
    try:
        summary = _parse(records)
    except PARSE_ERRORS as error:
        return Ending(wrong=f"it cannot be parsed: {error}")
    for i in summary.chunk_indexes:
        if i.chunk_start_offset + i.chunk_length + i.message_index_length > start:
            return Ending(wrong="it has chunks outside the data")
    return Ending(summary, data_end=start)


def _parse(records: bytes) -> Summary:
    summary = Summary()
    tables: dict[int, Callable[[bytes], None]] = {
        Opcode.CHUNK_INDEX: lambda content: summary.chunk_indexes.append(_chunk_index(content)),
        Opcode.SCHEMA: lambda content: _by_id(summary.schemas, Schema.read(stream(content))),
        Opcode.CHANNEL: lambda content: _by_id(summary.channels, Channel.read(stream(content))),
        Opcode.STATISTICS: lambda content: setattr(
            summary, "statistics", Statistics.read(stream(content))
        ),
        Opcode.ATTACHMENT_INDEX: lambda content: summary.attachment_indexes.append(
            AttachmentIndex.read(stream(content))
        ),
        Opcode.METADATA_INDEX: lambda content: summary.metadata_indexes.append(
            MetadataIndex.read(stream(content))
        ),
    }
    at = 0
    while at < len(records):
        opcode, length = RECORD.unpack_from(records, at)
        at += RECORD.size
        if at + length > len(records):
            raise ValueError("a record is longer than the summary")
        if opcode in tables:
            tables[opcode](records[at : at + length])
        at += length
    return summary


def stream(content: bytes) -> ReadDataStream:
    """A record's content as the official parsers take it."""
    return ReadDataStream(io.BytesIO(content))


def _by_id(table: dict[int, Any], record: Schema | Channel) -> None:
    table[record.id] = record


def _chunk_index(content: bytes) -> ChunkIndex:
    """As `ChunkIndex.read`, which takes a long log's thousands too slowly."""
    start, end, offset, length, size = _INDEX_HEAD.unpack_from(content)
    at = _INDEX_HEAD.size + size
    offsets = dict(_INDEX_ENTRY.iter_unpack(content[_INDEX_HEAD.size : at]))
    index_length, name_length = struct.unpack_from("<QI", content, at)
    at += 12
    compression = content[at : at + name_length].decode()
    compressed, uncompressed = _SIZES.unpack_from(content, at + name_length)
    return ChunkIndex(
        chunk_length=length,
        chunk_start_offset=offset,
        compression=compression,
        compressed_size=compressed,
        message_end_time=end,
        message_index_length=index_length,
        message_index_offsets=offsets,
        message_start_time=start,
        uncompressed_size=uncompressed,
    )
