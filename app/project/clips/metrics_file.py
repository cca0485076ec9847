"""Curves of a training as they lie in a project: one JSON object per line."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

from engine.storage.json_files import read_checked_lines

logger = logging.getLogger(__name__)

_MAX_COUNT = 2**31
"""Frames and clips are fewer."""


def read_metrics(path: Path) -> list[dict[str, Any]]:
    """Rows of a metrics file, each with its step; lines that are unfinished or damaged are left out."""
    try:
        rows, n_damaged = read_checked_lines(path)
    except FileNotFoundError:
        return []
    except OSError as error:
        logger.warning("the curves cannot be read (%s) - %s", error.strerror, path)
        return []
    good = [row for row in rows if type(row.get("step")) is int and 0 <= row["step"] < _MAX_COUNT]
    n_damaged += len(rows) - len(good)
    if n_damaged:
        logger.warning("%d damaged rows of curves were left out - %s", n_damaged, path)
    return good
