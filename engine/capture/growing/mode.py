"""Whether the capture that is being read may still be recorded. For readers, which are handed a folder and no more."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_is_growing: ContextVar[bool] = ContextVar("is_growing", default=False)


@contextmanager
def reading(*, is_growing: bool) -> Iterator[None]:
    """What this thread reads meanwhile may still be growing, or may not."""
    token = _is_growing.set(is_growing)
    try:
        yield
    finally:
        _is_growing.reset(token)


def is_growing() -> bool:
    """Whether what this thread reads may still be growing."""
    return _is_growing.get()
