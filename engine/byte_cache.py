"""ByteCache: values up to a number of bytes; what goes first is what was used longest ago, or what is wanted last."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")


class ByteCache(Generic[Key, Value]):
    """Values by key. Safe to use from several threads.

    Attributes:
        distance: How far off it is that a key is wanted; what is farthest goes first, and of equals what was used
            longest ago. Where it is None, only use counts.
        revision: Another number whenever other keys are held.

    Args:
        max_bytes: Beyond it values go. The newest always stays, however large.
    """

    def __init__(self, max_bytes: int) -> None:
        self.max_bytes = max_bytes
        self.distance: Callable[[Key], float] | None = None
        self.revision = 0
        self._values: OrderedDict[Key, tuple[Value, int]] = OrderedDict()
        self._n_bytes = 0
        self._lock = threading.Lock()

    def __len__(self) -> int:
        return len(self._values)

    @property
    def n_bytes(self) -> int:
        """Bytes held."""
        return self._n_bytes

    def __contains__(self, key: object) -> bool:
        """Whether there is a value; it does not become a more recent one."""
        with self._lock:
            return key in self._values

    def keys(self) -> list[Key]:
        """The keys of all values, those used longest ago first."""
        with self._lock:
            return list(self._values)

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
            self.revision += 1
            while self._n_bytes > self.max_bytes and len(self._values) > 1:
                self._n_bytes -= self._values.pop(self._farthest(key))[1]

    def _farthest(self, newest: Key) -> Key:
        """The next key to remove: of all but the newest."""
        others = (key for key in self._values if key != newest)
        return next(others) if self.distance is None else max(others, key=self.distance)  # the first of equals

    def drop(self, is_unwanted: Callable[[Key], bool]) -> None:
        """Forget every value whose key the predicate accepts."""
        with self._lock:
            for key in [key for key in self._values if is_unwanted(key)]:
                self._n_bytes -= self._values.pop(key)[1]
                self.revision += 1

    def clear(self) -> None:
        """Forget everything."""
        self.drop(lambda key: True)
