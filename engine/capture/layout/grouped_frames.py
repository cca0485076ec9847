"""Pictures listed one by one, each with a pose, put together into cameras that stand still.

For transforms.json, which knows pictures only: those with the same pose are of one camera, in the order of their times.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import PurePosixPath

import numpy as np

from engine.capture.files.frame_files import natural_key
from engine.capture.layout.format_checks import shortened

POSE_DIGITS = 6
"""Poses that are the same to so many places are of one camera."""
_COUNTER = re.compile(r"[_\-. ]+\d*$")


@dataclass(frozen=True, eq=False)
class ListedFrame:
    """One picture of a table.

    Attributes:
        file: As the table names it.
        camera_to_world: As the table has it. [4, 4]
        values: Its other values of the camera; must be the same in all pictures of one camera.
        time: When it was taken, in any unit; None where nothing says so.
        mask: File of its mask, or None.
        table: The file that lists it, among several.
    """

    file: str
    camera_to_world: np.ndarray
    values: dict[str, object]
    time: float | None = None
    mask: str | None = None
    table: str = ""


@dataclass(slots=True)
class FrameGroup:
    """Pictures of one camera, by time."""

    name: str = ""
    frames: list[ListedFrame] = field(default_factory=list)


def grouped(frames: Sequence[ListedFrame]) -> list[FrameGroup]:
    """Cameras with their pictures in the order of time, or of names; cameras in natural order of theirs."""
    by_pose: dict[bytes, FrameGroup] = {}
    for frame in frames:
        with np.errstate(over="ignore", invalid="ignore"):  # an invalid pose is refused later
            key = (np.round(frame.camera_to_world, POSE_DIGITS) + 0.0).tobytes()  # no minus zeros
        by_pose.setdefault(key, FrameGroup()).frames.append(frame)
    groups = list(by_pose.values())
    for group in groups:
        group.frames.sort(key=lambda frame: (frame.time or 0.0, natural_key(frame.file)))
    _name_all(groups)
    return sorted(groups, key=lambda group: natural_key(group.name))


def time_faults(groups: Sequence[FrameGroup]) -> tuple[list[float], list[str]]:
    """The times of all cameras, and what is wrong: times that a camera lacks or has twice.

    A camera that moves shows as many cameras with one time each.
    """
    times = sorted({frame.time for group in groups for frame in group.frames if frame.time is not None})
    n_single = sum(len(group.frames) == 1 for group in groups)
    if len(times) > 1 and n_single == len(groups) and len(groups) > 1:
        return times, [f"the {len(groups)} pictures have as many poses and {len(times)} times: the camera moves"]
    faults = []
    for group in groups:
        own = [frame.time for frame in group.frames]
        missing = sorted(set(times).difference(time for time in own if time is not None))
        if missing:
            listed = shortened([f"{time:g}" for time in missing])
            faults.append(f'camera "{group.name}" has no picture at {len(missing)} of {len(times)} times: {listed}')
        if len(set(own)) < len(own):
            faults.append(f'camera "{group.name}" has {len(own)} pictures at {len(set(own))} times')
    return times, faults


def _name_all(groups: Sequence[FrameGroup]) -> None:
    """Names from where the files lie: the folder of a camera, or what their names have in common."""
    folders = [{str(PurePosixPath(frame.file).parent) for frame in group.frames} for group in groups]
    n_with = {folder: sum(folder in own for own in folders) for own in folders for folder in own}
    for group, own in zip(groups, folders, strict=True):
        folder = next(iter(own))
        if len(own) == 1 and n_with[folder] == 1 and len(groups) > 1 and PurePosixPath(folder).name not in ("", ".."):
            group.name = PurePosixPath(folder).name
        else:
            stems = {PurePosixPath(frame.file).stem for frame in group.frames}
            group.name = min(stems) if len(stems) == 1 else _COUNTER.sub("", _shared_start(min(stems), max(stems)))
    names = [group.name for group in groups]
    if len(set(names)) < len(names) or not all(names):
        for row, group in enumerate(groups):
            group.name = f"camera{row:02d}"


def _shared_start(first: str, last: str) -> str:
    """The common beginning of the first and the last of sorted texts, and so of all between."""
    n_same = next(
        (row for row, (a, b) in enumerate(zip(first, last, strict=False)) if a != b), min(len(first), len(last))
    )
    return first[:n_same]
