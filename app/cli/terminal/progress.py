"""ProgressLine: how far a long job is, on a terminal as one line that redraws itself, elsewhere as plain lines."""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Callable
from typing import Any, TextIO

from app.training.rate import SmoothedRate
from engine.text import duration_text, printable

BAR_WIDTH = 24
REDRAW_EVERY_S = 0.1
PLAIN_FIRST_S, PLAIN_EVERY_S = 2.0, 10.0
"""Plain lines come rarely, but at the beginning of a job somebody may be waiting for a sign of life."""


class ProgressLine:
    """One line about one job after another.

    Args:
        stream: Where to write; standard error when None, so that results on standard output stay clean.
        is_quiet: Write nothing.
        clock: Seconds; tests bring their own.
    """

    def __init__(
        self, stream: TextIO | None = None, *, is_quiet: bool = False, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._is_quiet, self._clock = is_quiet, clock
        self._is_terminal = self._stream.isatty()
        self._written_s = self._began_s = -1e9
        self._stage = ""
        self._is_line_open = False

    def update(self, stage: str, done: float | None, detail: str = "") -> None:
        """Show a stage, its share 0..1, and other known figures (rate, time left, figures). done: None where nobody
        knows, as of something that is waited for."""
        now_s = self._clock()
        is_new = stage != self._stage
        if is_new:
            self._began_s = now_s
        plain_every_s = min(max(self._written_s - self._began_s, PLAIN_FIRST_S), PLAIN_EVERY_S)
        every_s = REDRAW_EVERY_S if self._is_terminal else plain_every_s
        if self._is_quiet or (not is_new and now_s - self._written_s < every_s):
            return
        if is_new:
            self._close_line()
        self._stage, self._written_s = stage, now_s
        stage, detail = printable(stage), printable(detail)
        done = None if done is None else min(max(done, 0.0), 1.0)
        if not self._is_terminal:
            share = ": " if done is None else f" {done * 100:3.0f} %  "
            self._write(f"{stage}{share}{detail}".rstrip() + "\n")
            return
        filled = round((done or 0.0) * BAR_WIDTH)
        bar = ":" if done is None else f" [{'#' * filled}{'.' * (BAR_WIDTH - filled)}] {done * 100:3.0f} % "
        text = f"{stage}{bar} {detail}"
        columns = shutil.get_terminal_size().columns
        self._write("\r" + text[: columns - 1].ljust(columns - 1))
        self._is_line_open = True

    def say(self, text: str) -> None:
        """A line that stays."""
        if not self._is_quiet:
            self._close_line()
            self._write(printable(text) + "\n")

    def finish(self) -> None:
        """Leave the last line standing."""
        self._close_line()
        self._stage = ""

    def _close_line(self) -> None:
        if self._is_line_open:
            self._write("\n")
            self._is_line_open = False

    def _write(self, text: str) -> None:
        print(text, end="", file=self._stream, flush=True)


def row_progress(line: ProgressLine, stage: str) -> Callable[[int, int, Any], None]:
    """A callback for done, all and what was done last, which shows a stage and how long it will take."""
    rate = SmoothedRate()

    def show(done: int, n: int, _row: Any) -> None:
        rate.update(done, time.monotonic())
        forecast = f", {rate.per_s:.1f}/s, {duration_text(rate.eta_s(n - done))} left" if rate.per_s > 0 else ""
        line.update(stage, done / max(n, 1), f"{done}/{n}{forecast}")

    return show


def stage_progress(line: ProgressLine) -> Callable[[str, int, int], None]:
    """A callback for the name of a stage, done and all, for work in stages."""
    shown: dict[str, Callable[[int, int, Any], None]] = {}

    def show(stage: str, done: int, n: int) -> None:
        shown.setdefault(stage, row_progress(line, stage))(done, n, None)

    return show
