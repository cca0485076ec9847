"""A child process that ends when the one that started it has died, also where that was killed."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from contextlib import suppress


def end_with_parent(before: Callable[[], None] = lambda: None) -> None:
    """From here on this process ends as soon as nobody holds the other end of its standard input.

    Args:
        before: Called then, for instance to remove files.
    """

    def wait() -> None:
        with suppress(OSError):
            os.read(0, 1)  # not sys.stdin, whose lock would be held when this process ends
        before()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()
