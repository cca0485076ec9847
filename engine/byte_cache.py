"""ByteCache: the values used last, up to a number of bytes."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")


class ByteCache(Generic[Key, Value]):
    """Most recently used values. Safe to use from several threads.

    Args:
        max_bytes: Beyond it the values used longest ago go. The newest always stays, however large.
    """

    def __init__(self, max_bytes: int) -> None:
        self.max_bytes = max_bytes
        self._values: OrderedDict[Key, tuple[Value, int]] = OrderedDict()
        self._n_bytes = 0
        self._lock = threading.Lock()

    def __len__(self) -> int:
        return len(self._values)

    @property
    def n_bytes(self) -> int:
        """Bytes held."""
        return self._n_bytes

    def get(self, key: Key) -> Value | None:
        """The value, which becomes the most recent one; None when it is not there."""
        with self._lock:
            if key not in self._values:
                return None
            self._values.move_to_end(key)
            return self._values[key][0]

    def put(self, key: Key, value: Value, n_bytes: int) -> None:
        """Keep a value of so many bytes."""
        with self._lock:
            replaced = self._values.pop(key, None)
            self._values[key] = (value, n_bytes)
            self._n_bytes += n_bytes - (0 if replaced is None else replaced[1])
            while self._n_bytes > self.max_bytes and len(self._values) > 1:
                self._n_bytes -= self._values.popitem(last=False)[1][1]

    def drop(self, is_unwanted: Callable[[Key], bool]) -> None:
        """Forget every value whose key the predicate accepts."""
        with self._lock:
            for key in [key for key in self._values if is_unwanted(key)]:
                self._n_bytes -= self._values.pop(key)[1]

    def clear(self) -> None:
        """Forget everything."""
        self.drop(lambda key: True)
