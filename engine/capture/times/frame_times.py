"""timestamps.csv: when each frame of each camera was taken, as Caliscope writes it."""

from __future__ import annotations

import csv
import io
import math
from collections import defaultdict
from pathlib import Path

import numpy as np

from engine.errors import CaptureError
from engine.storage.files import read_bytes
from engine.text import shown

TIMES_FILE = "timestamps.csv"
CAMERA_COLUMNS = ("cam_id", "port")
"""The camera; earlier versions of Caliscope call it port."""
TIME_COLUMN = "frame_time"
MAX_BYTES = 64 << 20


def read_frame_times_table(path: Path) -> dict[str, np.ndarray]:
    """Times of all frames by camera, in seconds, rising. {camera: [T]}

    Raises:
        CaptureError: It cannot be read, has no such columns, or a time that is not a number.
    """
    hint = f"It needs the columns {CAMERA_COLUMNS[0]} and {TIME_COLUMN}; or remove the file."
    try:
        text = read_bytes(path, max_bytes=MAX_BYTES).decode("utf-8-sig")
    except OSError as error:
        said = f"The times of frames cannot be read ({error.strerror})."
        raise CaptureError(said, hint="Check that you may read the file.", path=path) from error
    except UnicodeDecodeError as error:
        raise CaptureError(f"Byte {error.start} of the times is not UTF-8.", hint=hint, path=path) from error
    found: dict[str, list[float]] = defaultdict(list)
    try:
        rows = csv.reader(io.StringIO(text), strict=True)
        header = [name.strip() for name in next(rows, [])]
        camera_column = next((header.index(name) for name in CAMERA_COLUMNS if name in header), None)
        if camera_column is None or TIME_COLUMN not in header:
            raise CaptureError("The times of frames lack columns.", hint=hint, path=path)
        time_column = header.index(TIME_COLUMN)
        for row in rows:
            if row:
                found[row[camera_column].strip()].append(_time(row[time_column], rows.line_num, path))
    except (csv.Error, IndexError) as error:
        line = f"{error}" if isinstance(error, csv.Error) else "a row has too few columns"
        raise CaptureError(f"The times of frames are damaged ({line}).", hint=hint, path=path) from error
    return {camera: np.sort(np.array(times)) for camera, times in found.items()}


def _time(text: str, line: int, path: Path) -> float:
    try:
        time_s = float(text)
    except ValueError:
        time_s = math.nan
    if not math.isfinite(time_s):
        said = f"The time in line {line} is {shown(text)}."
        raise CaptureError(said, hint="Correct it, or remove the file.", path=path)
    return time_s
