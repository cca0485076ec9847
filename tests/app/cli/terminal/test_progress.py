"""Progress on a terminal and elsewhere, and durations in words."""

import io

from app.cli.terminal.progress import ProgressLine


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
