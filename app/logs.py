"""Logging set-up: one rotating file for the program, one plain file per worker."""

from __future__ import annotations

import logging
import logging.handlers
from pathlib import Path

from app.project import data_dir

FORMAT = "%(asctime)s %(levelname)s %(name)s: %(message)s"
MAX_LOG_BYTES = 2_000_000


def log_path() -> Path:
    """The program's log file."""
    return data_dir() / "logs" / "clipgstream.log"


def start_logging(path: Path | None = None) -> Path | None:
    """Send this program's records to a file. Returns the file, or None when the disk refused."""
    path = log_path() if path is None else path
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handler = logging.handlers.RotatingFileHandler(
            path, maxBytes=MAX_LOG_BYTES, backupCount=2, encoding="utf-8", delay=True
        )
    except OSError:
        return None
    handler.setFormatter(logging.Formatter(FORMAT))
    for package in ("app", "engine", "ui"):
        logger = logging.getLogger(package)
        logger.setLevel(logging.INFO)
        logger.addHandler(handler)
    return path


def tail(path: Path, n_lines: int = 12, *, max_bytes: int = 16_384) -> str:
    """Last lines of a text file; empty when there is none."""
    try:
        with path.open("rb") as file:
            size = file.seek(0, 2)
            file.seek(max(size - max_bytes, 0))
            text = file.read().decode("utf-8", errors="replace")
    except OSError:
        return ""
    return "\n".join(text.splitlines()[-n_lines:])
