"""Calibrations of other programs that lie in a folder which no layout fits, so that the message can name them."""

from __future__ import annotations

import os
from itertools import islice
from pathlib import Path

from engine.capture.files.folder_contents import MAX_LOOKED_AT

_READ = "put it into the folder or into calibration/, and the videos next to it or into videos/"
_KINDS = (
    (".qca.txt", "Qualisys", _READ),
    (".xcp", "Vicon", _READ),
    (".qca", "Qualisys", "export it from QTM as text (.qca.txt)"),
    (".mcal", "OptiTrack", "it is not read: write its cameras into capture.json"),
    (".calib", "bioCV", "it is not read: convert it with Pose2Sim, or write its cameras into capture.json"),
    (".pickle", "OpenCap", "pickles are not read: convert it with Pose2Sim"),
    (".psx", "Metashape", "export its cameras from Metashape as XML, next to the videos"),
    (".rcproj", "RealityCapture", "export its cameras from RealityCapture as XMP files, next to the videos"),
    ("intri.yml", "EasyMocap", "put it and extri.yml into the folder, and images/ next to them"),
    ("poses_bounds.npy", "LLFF", "put it into the folder, next to the videos"),
    ("transforms.json", "nerfstudio", "open the folder that it lies in"),
)
"""How the name ends, whose calibration it looks like, what to do. The first that fits counts."""


def foreign_calibrations(folder: Path) -> list[tuple[str, str]]:
    """The finding, as "calibration/Calib.qca.txt looks like a calibration of Qualisys", and the remedy.

    Looks at names only, in the folder and those in it. At most one of each kind.

    Raises:
        OSError: The folder cannot be read.
    """
    found: dict[str, tuple[str, str]] = {}
    with os.scandir(folder) as entries:
        names = sorted(entry.name for entry in islice(entries, MAX_LOOKED_AT) if not entry.name.startswith("."))
    for name in names:
        for place in (name, *_below(folder / name)):
            kind = next((row for row in _KINDS if place.lower().endswith(row[0])), None)
            if kind is not None and kind[0] not in found:
                found[kind[0]] = (f"{place} looks like a calibration of {kind[1]}", kind[2])
    return list(found.values())


def _below(folder: Path) -> list[str]:
    """Names in a folder with its own in front; nothing of what is not a folder or may not be read."""
    try:
        with os.scandir(folder) as entries:
            return sorted(f"{folder.name}/{entry.name}" for entry in islice(entries, MAX_LOOKED_AT // 10))
    except OSError:
        return []
