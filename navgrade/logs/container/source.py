"""Bytes of a log, wherever it lies: a path, an open file, or a URL."""

from __future__ import annotations

import io
import os
import threading
import weakref
from pathlib import Path
from typing import Any, BinaryIO, Protocol

import numpy as np
from numpy.typing import NDArray

from navgrade.errors import LogError

Bytes = NDArray[np.uint8]
_BLOCK = 1 << 18  # bytes a remote file is asked for at least


class Source(Protocol):
    """Bytes by their place in a file; safe to share between threads.

    Attributes
    ----------
    name : str
        For messages.
    size : int
        Bytes.
    remote : bool
        A request costs much more than its bytes.
    """

    name: str
    size: int
    remote: bool

    def read_into(self, offset: int, buffer: memoryview) -> int:
        """Fill the buffer from `offset` on; return how many bytes there were."""


def read_at(source: Source, offset: int, size: int) -> bytes:
    """At most `size` bytes from `offset` on; fewer at the end of the file."""
    buffer = bytearray(max(0, min(size, source.size - offset)))
    return bytes(buffer[: source.read_into(offset, memoryview(buffer))]) if buffer else b""


def open_source(where: str | Path | BinaryIO) -> Source:
    """Open a path, a binary file, or a URL such as ``https://...`` or ``s3://...``.

    Raises
    ------
    LogError
        When there is no such file, or the package that reads the URL is missing.
    """
    if isinstance(where, str) and "://" in where:
        return _RemoteSource(where)
    if not isinstance(where, str | os.PathLike):
        return _StreamSource(where, str(getattr(where, "name", "the log")))
    path = Path(where)
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "no such file"
        raise LogError(what, file=str(path))
    if hasattr(os, "preadv"):
        return _PathSource(path)
    return _StreamSource(path.open("rb"), str(path))


class _PathSource:
    remote = False

    def __init__(self, path: Path) -> None:
        self.name = str(path)
        self._file = os.open(path, os.O_RDONLY)
        # closed with the last reader: a thread may still be at it when its result is not wanted
        weakref.finalize(self, os.close, self._file)
        self.size = os.fstat(self._file).st_size

    def read_into(self, offset: int, buffer: memoryview) -> int:
        done = 0
        while done < len(buffer):
            count = os.preadv(self._file, [buffer[done:]], offset + done)
            if count == 0:
                break
            done += count
        return done


class _StreamSource:
    remote = False

    def __init__(self, stream: BinaryIO, name: str) -> None:
        self.name = name
        self._stream = stream
        self._lock = threading.Lock()
        self.size = stream.seek(0, io.SEEK_END)

    def read_into(self, offset: int, buffer: memoryview) -> int:
        with self._lock:
            self._stream.seek(offset)
            done = 0
            while done < len(buffer):
                piece = self._stream.read(len(buffer) - done)
                if not piece:
                    break
                buffer[done : done + len(piece)] = piece
                done += len(piece)
        return done


class _RemoteSource:
    remote = True

    def __init__(self, url: str) -> None:
        self.name = url
        try:
            from fsspec.core import url_to_fs

            self._system, self._path = url_to_fs(url)
            size: Any = self._system.info(self._path)["size"]
        except ImportError as error:
            raise LogError(
                f"reading from a URL needs more packages, pip install 'navgrade[remote]': {error}",
                file=url,
            ) from None
        except (OSError, ValueError) as error:
            raise LogError(f"cannot be opened: {error}", file=url) from None
        if size is None:
            raise LogError("the server does not tell the size; download the log first", file=url)
        self.size = int(size)
        self._block: tuple[int, bytes] = (0, b"")  # the last small request, read ahead

    def read_into(self, offset: int, buffer: memoryview) -> int:
        end = min(offset + len(buffer), self.size)
        start, held = self._block
        if not start <= offset <= end <= start + len(held):
            start = offset
            try:
                held = self._system.cat_file(
                    self._path, start, min(max(end, start + _BLOCK), self.size)
                )
            except OSError as error:
                raise LogError(f"cannot be read: {error}", file=self.name) from None
            if end - start <= _BLOCK:
                self._block = (start, held)
        piece = held[offset - start : end - start]
        buffer[: len(piece)] = piece
        return len(piece)
