"""Progress on a terminal and elsewhere, and durations in words."""

import io
import re

from app.cli.terminal.progress import ProgressLine, ProgressRow


class Stream(io.StringIO):
    """Collects what is written; says whether it is a terminal."""

    def __init__(self, is_terminal: bool) -> None:
        super().__init__()
        self._is_terminal = is_terminal

    def isatty(self) -> bool:
        return self._is_terminal

    @property
    def text(self) -> str:
        return self.getvalue()


def test_a_terminal_gets_one_line_that_redraws_itself():
    stream, now = Stream(True), iter(range(100))
    line = ProgressLine(stream, clock=lambda: float(next(now)))
    for share in (0.0, 0.5, 1.0):
        line.update("Training", share, "2:00 left")
    line.say("done")
    assert stream.text.count("\r") == 3
    assert stream.text.count("\n") == 2
    assert "[############............]  50 %" in stream.text


def test_elsewhere_there_are_plain_lines_not_too_many():
    stream = Stream(False)
    seconds = iter(range(100))
    line = ProgressLine(stream, clock=lambda: float(next(seconds)))
    for i in range(30):
        line.update("Training", i / 30, "")
    assert "\r" not in stream.text
    assert stream.text.count("\n") == 6  # after 0, 2, 4, 8 and 16 seconds, then one per ten seconds


def test_quiet_writes_nothing():
    stream = Stream(True)
    line = ProgressLine(stream, is_quiet=True)
    line.update("Training", 0.5)
    line.say("done")
    line.finish()
    assert stream.text == ""


def screen_after(text: str) -> list[str]:
    """What a terminal shows of it: lines without trailing blanks. Knows carriage returns and two escape sequences."""
    rows, at = [""], 0
    for part in re.findall(r"\x1b\[\d*[AJ]|[\r\n]|[^\x1b\r\n]+", text):
        if part.endswith("A") and part.startswith("\x1b"):
            at -= int(part[2:-1])
        elif part == "\x1b[J":
            del rows[at + 1 :]
        elif part == "\n":
            at += 1
            rows += [""] * (at + 1 - len(rows))
        elif part != "\r":
            rows[at] = part
    return [row.rstrip() for row in rows]


def several(*shares: float) -> list[ProgressRow]:
    return [ProgressRow(f"Clip {index}", share) for index, share in enumerate(shares)]


def test_several_jobs_are_drawn_in_place_and_texts_stay_above_them():
    stream, now = Stream(True), iter(range(100))
    line = ProgressLine(stream, clock=lambda: float(next(now)))
    line.update("Preparing", 1.0)
    line.show(several(0.0, 0.5, 0.25))
    line.show(several(0.1, 0.6, 0.35))
    shown = screen_after(stream.text)
    assert [row.split()[0] for row in shown] == ["Preparing", "Clip", "Clip", "Clip"]
    assert [row.split()[-2] for row in shown[1:]] == ["10", "60", "35"]
    line.say("Clip 0 is trained")
    line.show(several(0.2, 0.7))
    line.show(several(0.3))
    assert [row.partition(" [")[0] for row in screen_after(stream.text)] == ["Preparing", "Clip 0 is trained", "Clip 0"]
    line.finish()
    line.say("done")
    assert screen_after(stream.text)[-3].startswith("Clip 0 [")
    assert screen_after(stream.text)[-2:] == ["done", ""]


def test_a_low_terminal_keeps_the_last_of_several(monkeypatch):
    monkeypatch.setenv("LINES", "3")
    monkeypatch.setenv("COLUMNS", "60")
    stream = Stream(True)
    ProgressLine(stream).show(several(0.1, 0.2, 0.3, 0.4))
    assert [row[:6] for row in screen_after(stream.text)] == ["Clip 2", "Clip 3"]
    assert all(len(row) < 60 for row in screen_after(stream.text))


def test_elsewhere_several_jobs_are_plain_lines():
    stream, seconds = Stream(False), iter(range(100))
    line = ProgressLine(stream, clock=lambda: float(next(seconds)))
    for _ in range(30):
        line.show(several(0.5, 1.0))
    assert "\x1b" not in stream.text
    assert stream.text.splitlines() == ["Clip 0  50 %", "Clip 1 100 %"] * 6
