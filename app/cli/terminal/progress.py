"""ProgressLine: how far a long job is, or several at once, on a terminal as lines that redraw themselves, elsewhere as
plain lines."""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TextIO

from app.training.rate import SmoothedRate
from engine.text import duration_text, printable

BAR_WIDTH = 24
REDRAW_EVERY_S = 0.1
PLAIN_FIRST_S, PLAIN_EVERY_S = 2.0, 10.0
"""Plain lines come rarely, but at the beginning of a job somebody may be waiting for a sign of life."""


SEVERAL = "several jobs"
CLEAR_BELOW = "\x1b[J"


class ProgressRow(NamedTuple):
    """One of several jobs: its name, its share 0..1 or None where that is not known, and other known figures."""

    name: str
    done: float | None
    detail: str = ""


class ProgressLine:
    """One line about one job after another, or one for each of several.

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
        self._n_open = 0  # lines that are going to be drawn anew

    def update(self, stage: str, done: float | None, detail: str = "") -> None:
        """Show a stage, its share 0..1, and other known figures (rate, time left, figures). done: None where it is
        not known, as of something that is waited for."""
        if self._is_due(stage):
            self._draw([ProgressRow(stage, done, detail)])

    def show(self, rows: Sequence[ProgressRow]) -> None:
        """Show several jobs that run at the same time; a terminal that is too low shows the last of them."""
        if not self._is_due(SEVERAL):
            return
        if self._is_terminal:
            rows = rows[-max(shutil.get_terminal_size().lines - 1, 1) :]
        width = max((len(row.name) for row in rows), default=0)
        self._draw([row._replace(name=row.name.ljust(width)) for row in rows])

    def _is_due(self, stage: str) -> bool:
        """Whether it is time to write; lines of another job are closed before."""
        now_s = self._clock()
        is_new = stage != self._stage
        if is_new:
            self._began_s = now_s
        plain_every_s = min(max(self._written_s - self._began_s, PLAIN_FIRST_S), PLAIN_EVERY_S)
        every_s = REDRAW_EVERY_S if self._is_terminal else plain_every_s
        if self._is_quiet or (not is_new and now_s - self._written_s < every_s):
            return False
        if is_new:
            self._close_lines()
        self._stage, self._written_s = stage, now_s
        return True

    def _draw(self, rows: Sequence[ProgressRow]) -> None:
        texts = [_row_text(row, has_bar=self._is_terminal) for row in rows]
        if not self._is_terminal:
            self._write("".join(f"{text}\n" for text in texts))
            return
        columns = shutil.get_terminal_size().columns
        texts = [text[: columns - 1].ljust(columns - 1) for text in texts]
        rest = CLEAR_BELOW if self._n_open > len(texts) else ""  # of jobs that have ended
        self._write(self._to_first_line() + "\n".join(texts) + rest)
        self._n_open = len(texts)

    def _to_first_line(self) -> str:
        return "\r" + (f"\x1b[{self._n_open - 1}A" if self._n_open > 1 else "")

    def say(self, text: str) -> None:
        """A line that stays."""
        if self._is_quiet:
            return
        if self._n_open > 1:  # they are drawn anew below the text, soon
            self._write(self._to_first_line() + CLEAR_BELOW)
            self._n_open, self._written_s = 0, -1e9
        self._close_lines()
        self._write(printable(text) + "\n")

    def finish(self) -> None:
        """Leave the last lines standing."""
        self._close_lines()
        self._stage = ""

    def _close_lines(self) -> None:
        if self._n_open:
            self._write("\n")
            self._n_open = 0

    def _write(self, text: str) -> None:
        print(text, end="", file=self._stream, flush=True)


def _row_text(row: ProgressRow, *, has_bar: bool) -> str:
    name, detail = printable(row.name), printable(row.detail)
    if row.done is None:
        return f"{name}: {detail}"
    done = min(max(row.done, 0.0), 1.0)
    if not has_bar:
        return f"{name} {done * 100:3.0f} %  {detail}".rstrip()
    filled = round(done * BAR_WIDTH)
    return f"{name} [{'#' * filled}{'.' * (BAR_WIDTH - filled)}] {done * 100:3.0f} %  {detail}"


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
