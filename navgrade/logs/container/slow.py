"""JSON and protobuf messages, decoded one by one."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from mcap.records import Schema
from numpy.typing import NDArray

from navgrade.errors import SchemaError

SLOW_ENCODINGS = ("json", "protobuf")
_SECONDS = ("sec", "secs", "seconds")
_NANOSECONDS = ("nanosec", "nsec", "nsecs", "nanos", "nanoseconds")
_VECTORS = ("xyz", "xyzw", "xy")


def decoder(encoding: str, schema: Schema | None) -> Callable[[bytes], Any]:
    """Function from a message's bytes to an object with its members.

    Raises
    ------
    SchemaError
        When the package for it is missing, or the schema does not describe the messages.
    """
    if encoding == "json":
        return json.loads
    try:
        from mcap_protobuf.decoder import DecoderFactory
    except ImportError:
        raise SchemaError(
            "reading protobuf needs one more package, pip install 'navgrade[protobuf]'"
        ) from None
    found = DecoderFactory().decoder_for("protobuf", schema)
    if found is None:
        raise SchemaError("its schema does not describe protobuf messages")
    decode: Callable[[bytes], Any] = found
    return decode


def _member(value: Any, name: str) -> Any:
    if isinstance(value, dict):
        return value[name]
    if name.isdigit():
        return value[int(name)]
    return getattr(value, name)


def _names(value: Any) -> list[str] | None:
    """Names of a structure's members."""
    if isinstance(value, dict):
        return list(value)
    descriptor = getattr(value, "DESCRIPTOR", None)
    return None if descriptor is None else [field.name for field in descriptor.fields]


def _simple(value: Any) -> Any:
    """A number, a text, a vector as a list, or a time as ns."""
    names = _names(value)
    if names is None:
        return value if isinstance(value, bool | int | float | str) else list(value)
    if len(names) == 2 and names[0] in _SECONDS and names[1] in _NANOSECONDS:
        seconds, nanoseconds = (int(_member(value, name)) for name in names)
        return seconds * 1_000_000_000 + nanoseconds
    if "".join(names) in _VECTORS:
        return [_member(value, name) for name in names]
    raise TypeError(f"it is a structure of {', '.join(names)}")


def columns(
    decode: Callable[[bytes], Any], messages: Sequence[bytes], paths: Sequence[str]
) -> list[NDArray[Any]]:
    """One array a path: float64, int64 or bool, or objects for texts.

    Raises
    ------
    SchemaError
        When a message cannot be decoded or lacks a member.
    """
    found: list[list[Any]] = [[] for _ in paths]
    for message in messages:
        try:
            top = decode(message)
        except Exception as error:  # whatever a damaged message makes the decoder raise
            raise SchemaError(f"a message cannot be decoded: {error}") from None
        for path, values in zip(paths, found, strict=True):
            try:
                value = top
                for name in path.split("."):
                    value = _member(value, name)
                values.append(_simple(value))
            except (KeyError, IndexError, AttributeError, TypeError, ValueError) as error:
                raise SchemaError(f"a message has no {path} that can be read: {error}") from None
    return [_column(path, values) for path, values in zip(paths, found, strict=True)]


def _column(path: str, values: list[Any]) -> NDArray[Any]:
    if values and isinstance(values[0], str):
        return np.array(values, np.object_)
    try:
        column = np.array(values)
    except ValueError:
        raise SchemaError(f"{path} is not of the same length in all messages") from None
    if column.dtype.kind in "iu":
        return column.astype(np.int64)
    if column.dtype.kind == "f" or not len(column):
        return column.astype(np.float64)
    if column.dtype.kind == "b":
        return column
    raise SchemaError(f"{path} is neither a number nor a text in all messages")
