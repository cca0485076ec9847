"""Messages between processes: values of declared types as MessagePack, so that receiving one never runs code.

Besides what msgspec knows, paths, ranges and small arrays may be part of them. Large arrays cross as files.
"""

from __future__ import annotations

import os
from enum import IntEnum
from pathlib import Path
from typing import Any, cast

import msgspec
import numpy as np

from engine.children.kind import find
from engine.errors import CaptureError, EngineError

HEADER_BYTES = 9
"""Kind and length before every message."""


class Message(IntEnum):
    """Kinds of messages: first to the child, a job and commands, then from it."""

    JOB = 0
    COMMAND = 1
    EVENT = 2
    RESULT = 3
    ERROR = 4
    BEAT = 5


class Refusal(msgspec.Struct, frozen=True):
    """An EngineError on its way."""

    kind: str
    message: str
    hint: str
    path: str | None
    problems: tuple[Refusal, ...] = ()

    @staticmethod
    def of(error: EngineError) -> Refusal:
        """The error as a message."""
        problems = tuple(Refusal.of(problem) for problem in getattr(error, "problems", ()))
        path = None if error.path is None else str(error.path)
        return Refusal(type(error).__name__, error.message, error.hint, path, problems)

    def error(self) -> EngineError:
        """The error again; one of a class of the child's own as the nearest that both know."""
        kind = next((kind for kind in _kinds(EngineError) if kind.__name__ == self.kind), EngineError)
        problems = [problem.error() for problem in self.problems]
        if issubclass(kind, CaptureError):
            return kind(self.message, hint=self.hint, path=self.path, problems=problems)
        return kind(self.message, hint=self.hint, path=self.path)


def _kinds(kind: type[EngineError]) -> list[type[EngineError]]:
    return [kind, *(deeper for below in kind.__subclasses__() for deeper in _kinds(below))]


def encoded(value: object) -> bytes:
    """The bytes of a value; `decoded` is the inverse."""
    return msgspec.msgpack.encode(value, enc_hook=_plain)


def framed(kind: Message, value: object) -> bytes:
    """One message with its header."""
    data = encoded(value)
    return bytes([kind]) + len(data).to_bytes(HEADER_BYTES - 1, "little") + data


def decoded(data: bytes, kind: object) -> Any:
    """The value of a message.

    Args:
        kind: Its type, or "module:name" of it.
    Raises:
        msgspec.DecodeError: It is not of this kind.
    """
    return msgspec.msgpack.decode(
        data, type=find(kind) if isinstance(kind, str) else cast("Any", kind), dec_hook=_special
    )


def read_message(descriptor: int) -> tuple[Message, bytes] | None:
    """Wait for the next message of a pipe, which keeps others from nothing. None at its end, also in the middle."""
    header = _read(descriptor, HEADER_BYTES)
    data = None if header is None else _read(descriptor, int.from_bytes(header[1:], "little"))
    return None if header is None or data is None else (Message(header[0]), data)


def _read(descriptor: int, n_bytes: int) -> bytes | None:
    """Not through a file of Python, whose lock a thread would hold while the program ends."""
    parts: list[bytes] = []
    while n_bytes:
        try:
            part = os.read(descriptor, min(n_bytes, 1 << 20))
        except OSError:
            return None
        if not part:
            return None
        parts.append(part)
        n_bytes -= len(part)
    return b"".join(parts)


def write_all(descriptor: int, data: bytes) -> None:
    """Write a whole message. Raises OSError once nobody reads."""
    left = memoryview(data)
    while left:
        left = left[os.write(descriptor, left) :]


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, range):
        return value.start, value.stop, value.step
    raise NotImplementedError(f"{type(value)} cannot cross between processes")


def _special(kind: type, value: Any) -> object:
    if kind is np.ndarray:
        dtype, shape, data = msgspec.convert(value, tuple[str, tuple[int, ...], bytes])
        return np.frombuffer(bytearray(data), dtype).reshape(shape)
    if issubclass(kind, Path):
        return Path(value)
    if kind is range:
        return range(*msgspec.convert(value, tuple[int, int, int]))
    raise NotImplementedError(f"{kind} cannot cross between processes")
