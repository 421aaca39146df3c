"""Damage done to logs: by the byte, by the record, and inside chunks with their checksum mended.

A mutation changes a list of parts: the magic, each record, the magic; or one part, where a
mutation before it went across records.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from random import Random

import lz4.frame
import zstandard

MAGIC = b"\x89MCAP0\r\n"
HEAD = struct.Struct("<BQ")  # opcode, length
CHUNK_HEAD = struct.Struct("<QQQII")  # start, end, size, crc, length of the compression's name
SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX = 0x03, 0x04, 0x05, 0x06, 0x07
CHUNK_INDEX, FOOTER, DATA_END = 0x08, 0x02, 0x0F

NUMBERS = (0, 1, 2, 7, 0xFF, 0xFFFF, 1 << 24, (1 << 31) - 1, 1 << 31, (1 << 32) - 1, 1 << 40)
NUMBERS += ((1 << 62), (1 << 63) - 1, 1 << 63, (1 << 64) - 1)
NAMES = (b"", b"zstd", b"lz4", b"brotli", b"\xff\xfe", b"zst", b"none" * 100)

_LINE = "=" * 80
SCHEMA_TEXTS = (
    "",
    "A a\n" + f"{_LINE}\nMSG: demo_msgs/A\nA a\n",  # holds itself
    "A a\n" + f"{_LINE}\nMSG: demo_msgs/A\nB b\n" + f"{_LINE}\nMSG: demo_msgs/B\nA[] a\n",
    "float64[4000000000] a\nfloat64 x\n",
    "A[60000] a\n" + f"{_LINE}\nMSG: demo_msgs/A\nB[60000] b\n{_LINE}\nMSG: demo_msgs/B\nbool c\n",
    "A[9] a\n"
    + "".join(f"{_LINE}\nMSG: demo_msgs/{a}\n{b}[9] m\n" for a, b in pairwise("ABCDEFGHI"))
    + f"{_LINE}\nMSG: demo_msgs/I\nfloat64 x\n",
    "".join(f"float64 x{k}\n" for k in range(3000)),
    "".join(f"string s{k}\n" for k in range(300)),
    "float64 x\nfloat64 x\n",
    "A[] a\n" + f"{_LINE}\nMSG: demo_msgs/A\n",  # a sequence of nothing
    "A[0] a\nfloat64[0] x\n" + f"{_LINE}\nMSG: demo_msgs/A\n",
    "nowhere/Type a\n",
    "float64[ a\n]float64 b\n",
    "float64[99999999999999999999999] a\n",
    "string<=5[<=3][] a\nwstring b\nstring[7] c\n",
    f"{_LINE}\n" * 50,
)


@dataclass
class Mutant:
    """A log being mutated.

    Attributes
    ----------
    parts : list of bytes
    forged : bool
        The inside of a chunk was changed and its checksum mended: nothing can tell.
    misled : bool
        An index was changed and the summary's checksum mended: messages may be missed.
    steps : list of str
        What was done.
    """

    parts: list[bytes]
    forged: bool = False
    misled: bool = False
    steps: list[str] = field(default_factory=list)

    @property
    def data(self) -> bytes:
        return b"".join(self.parts)


def split(data: bytes) -> list[bytes]:
    """The magic, each record with its head, the magic."""
    return [MAGIC, *split_records(data[len(MAGIC) : -len(MAGIC)]), MAGIC]


def split_records(data: bytes) -> list[bytes]:
    """Each record with its head; what cannot be one is the last."""
    parts, at = [], 0
    while at + HEAD.size <= len(data):
        _, length = HEAD.unpack_from(data, at)
        parts.append(data[at : at + HEAD.size + length])
        at += HEAD.size + length
    return parts + [data[at:]] * (at < len(data))


# ---- bytes -------------------------------------------------------------------------------------


def _flipped(rng: Random, data: bytes) -> bytes:
    if not data:
        return data
    at = rng.randrange(len(data))
    return data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]


def _overwritten(rng: Random, data: bytes) -> bytes:
    at, count = rng.randrange(len(data) + 1), rng.randint(1, 64)
    run = rng.choice((bytes(count), b"\xff" * count, rng.randbytes(count)))
    return (data[:at] + run)[: len(data)] + data[at + count :]


def _inserted(rng: Random, data: bytes) -> bytes:
    at = rng.randrange(len(data) + 1)
    return data[:at] + rng.randbytes(rng.randint(1, 64)) + data[at:]


def _removed(rng: Random, data: bytes) -> bytes:
    at = rng.randrange(len(data) + 1)
    return data[:at] + data[at + rng.randint(1, 64) :]


def _number(rng: Random, data: bytes) -> bytes:
    """An absurd number in the place of some two, four or eight bytes."""
    size = rng.choice((2, 4, 8))
    if len(data) < size:
        return data
    at = rng.randrange(len(data) - size + 1)
    if rng.random() < 0.5:
        at &= ~3  # where the lengths of CDR stand
    value = rng.choice(NUMBERS) & ((1 << 8 * size) - 1)
    return data[:at] + value.to_bytes(size, "little") + data[at + size :]


BYTES = (_flipped, _overwritten, _inserted, _removed, _number)


def flip_bit(rng: Random, mutant: Mutant) -> None:
    mutant.parts = [_flipped(rng, mutant.data)]


def change_bytes(rng: Random, mutant: Mutant) -> None:
    mutant.parts = [rng.choice(BYTES)(rng, mutant.data)]


def truncate(rng: Random, mutant: Mutant) -> None:
    data = mutant.data
    mutant.parts = [data[: rng.randrange(len(data) + 1)]]


def zero_tail(rng: Random, mutant: Mutant) -> None:
    data = mutant.data
    at = rng.randrange(len(data) + 1)
    mutant.parts = [data[:at] + bytes(len(data) - at)]


# ---- records -----------------------------------------------------------------------------------


def swap_records(rng: Random, mutant: Mutant) -> None:
    parts = mutant.parts
    i, j = rng.randrange(len(parts)), rng.randrange(len(parts))
    parts[i], parts[j] = parts[j], parts[i]


def repeat_record(rng: Random, mutant: Mutant) -> None:
    parts = mutant.parts
    parts.insert(rng.randrange(len(parts)), rng.choice(parts))


def drop_record(rng: Random, mutant: Mutant) -> None:
    del mutant.parts[rng.randrange(len(mutant.parts))]


def cut_between_records(rng: Random, mutant: Mutant) -> None:
    del mutant.parts[rng.randrange(1, len(mutant.parts) + 1) :]


def record_length(rng: Random, mutant: Mutant) -> None:
    """A record that claims another length."""
    i = rng.randrange(len(mutant.parts))
    part = mutant.parts[i]
    if len(part) < HEAD.size:
        return
    opcode, length = HEAD.unpack_from(part)
    near = (max(length - 1, 0), length + 1 & ((1 << 64) - 1), length // 2)
    mutant.parts[i] = HEAD.pack(opcode, rng.choice(NUMBERS + near)) + part[HEAD.size :]


def record_field(rng: Random, mutant: Mutant) -> None:
    """An absurd number somewhere in the first bytes of a record, where its lengths stand."""
    i = rng.randrange(len(mutant.parts))
    part = mutant.parts[i]
    mutant.parts[i] = part[: HEAD.size] + _number(rng, part[HEAD.size : 80]) + part[80:]


def opcode(rng: Random, mutant: Mutant) -> None:
    i = rng.randrange(len(mutant.parts))
    mutant.parts[i] = bytes([rng.choice((*range(17), 0x80, 0xFF))]) + mutant.parts[i][1:]


# ---- chunks ------------------------------------------------------------------------------------


def _chunks(mutant: Mutant) -> list[int]:
    return [
        i
        for i, part in enumerate(mutant.parts)
        if part[:1] == bytes([CHUNK]) and len(part) > HEAD.size + CHUNK_HEAD.size + 12
    ]


def _open(part: bytes) -> tuple[tuple[int, int], str, bytes]:
    """Times, compression and records of a chunk."""
    start, end, _, _, length = CHUNK_HEAD.unpack_from(part, HEAD.size)
    at = HEAD.size + CHUNK_HEAD.size
    compression = part[at : at + length].decode()
    return (start, end), compression, decompressed(compression, part[at + length + 8 :])


def decompressed(compression: str, stored: bytes) -> bytes:
    """The records of a whole chunk."""
    if compression == "zstd":
        return zstandard.ZstdDecompressor().decompressobj().decompress(stored)
    return lz4.frame.decompress(stored) if compression == "lz4" else stored


def compressed(compression: str, records: bytes) -> bytes:
    """Records as a chunk stores them."""
    if compression == "zstd":
        return zstandard.compress(records, 1)
    return bytes(lz4.frame.compress(records)) if compression == "lz4" else records


def chunk(times: tuple[int, int], compression: bytes, stored: bytes, size: int, crc: int) -> bytes:
    """A chunk record, true or not."""
    content = CHUNK_HEAD.pack(*times, size, crc, len(compression)) + compression
    content += struct.pack("<Q", len(stored)) + stored
    return HEAD.pack(CHUNK, len(content)) + content


def chunk_name(rng: Random, mutant: Mutant) -> None:
    """A chunk that claims another compression."""
    if not (chunks := _chunks(mutant)):
        return
    i = rng.choice(chunks)
    times, compression, records = _open(mutant.parts[i])
    stored = compressed(compression, records)
    name = rng.choice(NAMES)
    mutant.parts[i] = chunk(times, name, stored, len(records), zlib.crc32(records))


@cache
def _zeros(compression: str, megabytes: int, told: bool) -> bytes:
    block = bytes(1 << 20)
    if compression == "lz4":
        context = lz4.frame.LZ4FrameCompressor()
        size = megabytes << 20 if told else 0
        parts = [context.begin(size), *(context.compress(block) for _ in range(megabytes))]
        return b"".join([*parts, context.flush()])
    packer = zstandard.ZstdCompressor(1).compressobj(megabytes << 20 if told else -1)
    return b"".join([packer.compress(block) for _ in range(megabytes)] + [packer.flush()])


def bomb(rng: Random, mutant: Mutant) -> None:
    """A chunk of few bytes that become very many."""
    if not (chunks := _chunks(mutant)):
        return
    i = rng.choice(chunks)
    compression = rng.choice(("zstd", "lz4"))
    megabytes = rng.choice((16, 64, 2048) if compression == "zstd" else (16, 64))
    stored = _zeros(compression, megabytes, rng.random() < 0.5)
    size = rng.choice((1000, megabytes << 20, (megabytes << 20) - 1, 1 << 30, 1 << 62))
    times = struct.unpack_from("<QQ", mutant.parts[i], HEAD.size)
    mutant.parts[i] = chunk(times, compression.encode(), stored, size, rng.choice((0, 1)))


def inside_chunk(rng: Random, mutant: Mutant) -> None:
    """Bytes or records inside a chunk changed, its size and checksum mended."""
    if not (chunks := _chunks(mutant)):
        return
    i = rng.choice(chunks)
    times, compression, records = _open(mutant.parts[i])
    change = rng.choice((*BYTES, *RECORDS, *RECORDS))
    if change in RECORDS:
        inner = Mutant(split_records(records))
        if not inner.parts:
            return
        change(rng, inner)
        records = inner.data
    else:
        records = change(rng, records)
    stored = compressed(compression, records)
    mutant.parts[i] = chunk(times, compression.encode(), stored, len(records), zlib.crc32(records))
    mutant.forged = True
    mutant.steps.append(change.__name__)


def _of(mutant: Mutant, opcode: int) -> list[int]:
    return [i for i, part in enumerate(mutant.parts) if part[:1] == bytes([opcode])]


def payload(rng: Random, mutant: Mutant) -> None:
    """An absurd number or an end inside a message's payload."""
    if not (found := _of(mutant, MESSAGE)):
        return
    i = rng.choice(found)
    part = mutant.parts[i]
    begin = HEAD.size + 22  # behind channel, sequence and times
    if len(part) < begin:
        return
    body = rng.choice(
        (_number(rng, part[begin:]), part[begin : rng.randint(begin, len(part))], b"[" * 5000)
    )
    mutant.parts[i] = HEAD.pack(MESSAGE, 22 + len(body)) + part[HEAD.size : begin] + body


def schema_text(rng: Random, mutant: Mutant) -> None:
    """A schema with another text: one that never ends, or a mutated one."""
    if not (found := _of(mutant, SCHEMA)):
        return
    i = rng.choice(found)
    content = mutant.parts[i][HEAD.size :]
    at = 2
    for _ in range(2):  # name, encoding
        at += 4 + int.from_bytes(content[at : at + 4], "little")
    text = rng.choice(
        (*(t.encode() for t in SCHEMA_TEXTS), rng.choice(BYTES)(rng, content[at + 4 :]))
    )
    content = content[:at] + struct.pack("<I", len(text)) + text
    mutant.parts[i] = HEAD.pack(SCHEMA, len(content)) + content


def channel(rng: Random, mutant: Mutant) -> None:
    """A channel with another number, schema or encoding."""
    if not (found := _of(mutant, CHANNEL)):
        return
    i = rng.choice(found)
    content = mutant.parts[i][HEAD.size :]
    if rng.random() < 0.5:
        at = rng.choice((0, 2))
        content = content[:at] + struct.pack("<H", rng.randrange(7)) + content[at + 2 :]
    else:
        for encoding in (b"cdr", b"ros1", b"json"):
            other = rng.choice((b"cdr", b"ros1", b"json", b"protobuf", b"", b"xml"))
            old = struct.pack("<I", len(encoding)) + encoding
            content = content.replace(old, struct.pack("<I", len(other)) + other, 1)
    mutant.parts[i] = HEAD.pack(CHANNEL, len(content)) + content


def lying_index(rng: Random, mutant: Mutant) -> None:
    """A message index or chunk index whose entries point elsewhere; the summary's sum mended."""
    if not (found := _of(mutant, rng.choice((MESSAGE_INDEX, CHUNK_INDEX)))):
        return
    i = rng.choice(found)
    part = mutant.parts[i]
    mutant.parts[i] = part[: HEAD.size] + rng.choice((_flipped, _number))(rng, part[HEAD.size :])
    _mend_summary(mutant)


def _mend_summary(mutant: Mutant) -> None:
    if not (footers := _of(mutant, FOOTER)) or len(mutant.parts[footers[-1]]) != HEAD.size + 20:
        return
    footer = mutant.parts[footers[-1]]
    (start,) = struct.unpack_from("<Q", footer, HEAD.size)
    before = b"".join(mutant.parts[: footers[-1]])
    crc = zlib.crc32(before[start:] + footer[: HEAD.size + 16])
    mutant.parts[footers[-1]] = footer[: HEAD.size + 16] + struct.pack("<I", crc)
    mutant.misled = True


Mutation = Callable[[Random, Mutant], None]
RECORDS: tuple[Mutation, ...] = (
    swap_records,
    repeat_record,
    drop_record,
    record_length,
    record_field,
    opcode,
    payload,
    schema_text,
    channel,
)
MUTATIONS: dict[Mutation, int] = {  # with their weights, in the order they are done
    inside_chunk: 24,
    chunk_name: 2,
    bomb: 1,
    lying_index: 4,
    record_length: 5,
    record_field: 8,
    payload: 2,
    schema_text: 2,
    channel: 2,
    opcode: 2,
    swap_records: 3,
    repeat_record: 3,
    drop_record: 4,
    cut_between_records: 2,
    flip_bit: 20,
    change_bytes: 10,
    truncate: 8,
    zero_tail: 4,
}


def mutated(rng: Random, data: bytes) -> Mutant:
    """One to three different mutations of a log."""
    mutant = Mutant(split(data))
    chosen = set(
        rng.choices(tuple(MUTATIONS), tuple(MUTATIONS.values()), k=rng.choice((1, 1, 2, 3)))
    )
    for mutation in MUTATIONS:
        if mutation in chosen and mutant.parts:
            mutant.steps.append(mutation.__name__)
            mutation(rng, mutant)
    return mutant
