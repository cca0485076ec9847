"""Which video belongs to which camera where no video is called as its camera: how motion capture programs name both.

Qualisys and Vicon put the camera's serial number somewhere into the name, anipose and others a trial before or behind
the camera's name, Pose2Sim goes by order. All of it is about names; nothing is opened, and no pattern of a file is run.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence

from engine.capture.files.frame_files import natural_key, plain_name
from engine.capture.layout.format_checks import shortened
from engine.errors import CaptureError
from engine.text import shown

MIN_DIGITS = 4
"""Of a serial number; shorter numbers are those of takes and trials."""
_NUMBERS = re.compile(r"\d+")
_POSE2SIM = re.compile(r"(?:int|ext)_(.+?)_(?:img|images)|(?:int|ext)_(.+)", re.IGNORECASE)


def folder_names(name: str) -> list[str]:
    """A camera's other name, as Pose2Sim names it after its folder: cam1 of "int_cam1_img"."""
    found = _POSE2SIM.fullmatch(name)
    return [] if found is None else [found[1] or found[2]]


def by_serial(names: Sequence[str], videos: Sequence[str]) -> dict[str, str]:
    """Videos whose names have a camera's serial number in them, each the only one with it: by name of the camera.

    Args:
        names: Of the cameras; others than numbers of at least MIN_DIGITS digits have no serial number.
        videos: File names, with or without their folders.
    """
    numbers = {video: set(_NUMBERS.findall(_stem(video))) for video in videos}
    found: dict[str, str] = {}
    for name in names:
        having = [video for video in videos if name in numbers[video]]
        if len(name) >= MIN_DIGITS and name.isdecimal() and len(having) == 1:
            found[name] = having[0]
    return found


def by_pattern(names: Sequence[str], videos: Sequence[str]) -> dict[str, str]:
    """Videos that are called as their cameras with the same text before and behind: trial01_cam1 and trial01_cam2.

    Args:
        names: Of at least two cameras.
        videos: File names, with or without their folders.
    Returns:
        A video for each camera, or nothing where no text fits them all.
    Raises:
        CaptureError: Several texts do, as where there are several trials.
    """
    by_stem: dict[str, list[str]] = {}
    for video in videos:
        by_stem.setdefault(plain_name(_stem(video)), []).append(video)
    wanted = [plain_name(name) for name in names]
    if len(set(wanted)) < max(2, len(names)) or not all(wanted):
        return {}
    fits = [
        (before, behind)
        for stem in by_stem
        for before, behind in _around(stem, wanted[0])
        if all(len(by_stem.get(before + name + behind, ())) == 1 for name in wanted)
    ]
    if len(fits) > 1:
        of_first = shortened([shown(os.path.basename(by_stem[a + wanted[0] + b][0])) for a, b in fits])
        text = f"Videos of {len(fits)} recordings match the cameras: that of {shown(names[0])} may be {of_first}."
        raise CaptureError(text, hint="Put the videos of one recording and the calibration into a folder of their own.")
    return (
        {} if not fits else {name: by_stem[fits[0][0] + plain + fits[0][1]][0] for name, plain in _pairs(names, wanted)}
    )


def by_order(names: Sequence[str], videos: Sequence[str]) -> Mapping[str, str]:
    """As many videos as cameras, both in the order in which people count; nothing where they are not as many."""
    if len(names) != len(videos):
        return {}
    return dict(zip(sorted(names, key=natural_key), sorted(videos, key=natural_key), strict=True))


def _pairs(names: Sequence[str], plain: Sequence[str]) -> list[tuple[str, str]]:
    return list(zip(names, plain, strict=True))


def _around(stem: str, name: str) -> list[tuple[str, str]]:
    """The parts of a text before and after a name, once for each place where the text has it."""
    places = [at for at in range(len(stem) - len(name) + 1) if stem.startswith(name, at)]
    return [(stem[:at], stem[at + len(name) :]) for at in places]


def _stem(video: str) -> str:
    return os.path.splitext(os.path.basename(video))[0]
