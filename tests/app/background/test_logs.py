"""The program's log: written by several processes at once, moved aside when large, and never heard of when it fails."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from pathlib import Path

import pytest

from app.background.logs import N_OLD, PrintableFormatter, SharedLogHandler, start_logging
from engine.text import printable

ROOT = Path(__file__).resolve().parents[3]
WRITER = """
import logging, sys
from pathlib import Path
from app.background import logs
handler = logs.SharedLogHandler(Path(sys.argv[1]), max_bytes=20_000)
handler.setFormatter(logs.PrintableFormatter(logs.FORMAT))
logger = logging.getLogger("app")
logger.setLevel(logging.INFO)
logger.addHandler(handler)
for i in range(400):
    logger.info("record %s of %s %s", i, sys.argv[2], "x" * 40)
"""


@pytest.fixture
def no_handlers():
    """The program's loggers as they were before."""
    loggers = [logging.getLogger(name) for name in ("app", "engine", "ui")]
    before = [(logger.handlers[:], logger.level) for logger in loggers]
    raises = logging.raiseExceptions
    yield
    logging.raiseExceptions = raises
    for logger, (handlers, level) in zip(loggers, before, strict=True):
        logger.handlers[:] = handlers
        logger.setLevel(level)


@pytest.mark.slow
def test_several_processes_share_a_log_beyond_its_size(tmp_path):
    path = tmp_path / "clipgstream.log"
    writers = [
        subprocess.Popen([sys.executable, "-c", WRITER, str(path), name], cwd=ROOT, stderr=subprocess.PIPE, text=True)
        for name in "abc"
    ]
    assert [writer.communicate()[1] for writer in writers] == ["", "", ""]
    files = [path.with_name(f"clipgstream.log.{i}") for i in range(N_OLD, 0, -1)] + [path]
    lines = [line for file in files if file.exists() for line in file.read_text().splitlines()]
    assert len(lines) > 300
    assert all(" INFO app: record " in line and line.endswith("x" * 40) for line in lines)  # none torn, none mixed
    assert max(file.stat().st_size for file in files if file.exists()) < 25_000
    assert sorted(file.name for file in tmp_path.iterdir() if file.suffix != ".lock") == sorted(f.name for f in files)
    for name in "abc":  # and what is kept of each is in order
        numbers = [int(line.split("record ")[1].split()[0]) for line in lines if f" of {name} " in line]
        assert numbers == sorted(numbers)


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("cam\x1b[31m\x9b0m", "cam\\x1b[31m\\x9b0m"),
        ("\ud800.mp4", "\\ud800.mp4"),
        ("left\u202eright\u2028", "left\\u202eright\\u2028"),
        ("cr\rbell\x07", "cr\\rbell\\x07"),
        ("é 日本 👍 two\nlines", "é 日本 👍 two\nlines"),
    ],
)
def test_what_a_terminal_would_obey_is_written_out(tmp_path, text, shown):
    assert printable(text) == shown
    handler = SharedLogHandler(tmp_path / "log")
    handler.setFormatter(PrintableFormatter("%(message)s"))
    handler.emit(logging.LogRecord("app", logging.INFO, "", 0, "%s", (text,), None))
    assert (tmp_path / "log").read_text("utf-8") == shown + "\n"


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no device that is always full here")
def test_a_full_disk_and_a_broken_record_are_never_heard_of(capsys, no_handlers, monkeypatch):
    monkeypatch.setattr(SharedLogHandler, "_move_aside", lambda self: None)
    handler = SharedLogHandler(Path("/dev/full"))
    with pytest.raises(OSError, match="space"):
        handler.write(b"x")
    logger = logging.getLogger("app.test")
    logger.propagate = False  # pytest's own handler raises
    logger.addHandler(handler)
    logger.error("full")
    logger.error("%d of %d", "not a number")
    logger.removeHandler(handler)
    logger.propagate = True
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("kind", ["below a file", "a folder"])
def test_a_log_that_cannot_be_written_is_none_and_silent(tmp_path, capsys, no_handlers, kind):
    (tmp_path / "file").write_text("")
    (tmp_path / "log").mkdir()
    assert start_logging(tmp_path / "file" / "log" if kind == "below a file" else tmp_path / "log") is None
    logging.getLogger("app").error("nobody hears this")
    assert capsys.readouterr() == ("", "")
