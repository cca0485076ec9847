"""KeptReader: reads kept figures on its own thread, clip by clip; results are polled."""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from app.project.opening.opened_project import OpenedProject
from app.residuals.figures import ClipMeasurements
from engine.children.priority import lower_thread
from engine.errors import EngineError

if TYPE_CHECKING:
    from app.residuals.kept_reading import Stamp  # brings torch, which only the thread needs

logger = logging.getLogger(__name__)

PAUSE_S = 0.002
"""Between clips: parsing holds the interpreter lock, which the window needs too."""


class KeptReader:
    """One reading. For one thread, besides the one it owns.

    Args:
        opened: The project.
        trained: Clips that can be measured.
        clip_indices: Those that are read, as far as figures of them are kept.
        known: Stamps of clips that are only read if they have another one now.

    Attributes:
        stamps: Those of the clips before they were read.
    """

    def __init__(
        self,
        opened: OpenedProject,
        trained: Sequence[int],
        clip_indices: Sequence[int],
        known: Mapping[int, Stamp] | None = None,
    ) -> None:
        self._opened, self._trained, self._clip_indices = opened, list(trained), list(clip_indices)
        self._known, self.stamps = dict(known or {}), dict[int, "Stamp"]()
        self._found: queue.SimpleQueue[ClipMeasurements | str] = queue.SimpleQueue()
        self._is_cancelled = threading.Event()
        self._thread = threading.Thread(target=self._run, name="kept figures", daemon=True)
        self._thread.start()

    def poll(self, n_at_most: int = 20) -> list[ClipMeasurements | str]:
        """Figures read since the last call, and sentences for the user."""
        found: list[ClipMeasurements | str] = []
        while len(found) < n_at_most:
            try:
                found.append(self._found.get_nowait())
            except queue.Empty:
                break
        return found

    @property
    def is_done(self) -> bool:
        """Whether everything was read and polled."""
        return not self._thread.is_alive() and self._found.empty()

    def cancel(self) -> None:
        """End soon."""
        self._is_cancelled.set()

    def _run(self) -> None:
        lower_thread()
        try:
            self._read()
        except EngineError as error:
            self._found.put(str(error))
        except Exception:  # the edge of a thread: figures are measured again
            logger.exception("kept figures could not be read")

    def _read(self) -> None:
        from app.evaluation.headless import open_trained
        from app.residuals.kept_reading import read_kept, stamps

        self.stamps = stamps(self._opened.project, self._clip_indices)
        to_read = [index for index, stamp in self.stamps.items() if stamp != self._known.get(index)]
        if not to_read:
            return
        opened = open_trained(self._opened.project, self._opened.capture)
        for found in read_kept(opened, self._trained, to_read, self._found.put):
            if self._is_cancelled.is_set():
                return
            self._found.put(found)
            time.sleep(PAUSE_S)
