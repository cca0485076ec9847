"""Which frames belong to which camera, by name: a video, a folder of images or one image per camera."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from engine.capture.files.frame_files import (
    IMAGE_SUFFIXES,
    VIDEO_SUFFIXES,
    Files,
    folders_in,
    frames_in_folder,
    listed,
    natural_key,
    plain_name,
)
from engine.capture.files.places import place_in
from engine.capture.layout.format_checks import shortened
from engine.errors import CaptureError
from engine.text import shown

PLACES = ("", "videos", "images", "input", "frames", "rgb")
"""Folders of a capture in which cameras have their videos, folders or images; the first is the capture's own."""


@dataclass(frozen=True, eq=False)
class CameraFrames:
    """Frames of cameras.

    Attributes:
        files: By camera: a video, or one image per frame.
        problems: By camera: why its folder cannot be used.
        left_over: Files and folders of the same kind that belong to no camera.
    """

    files: dict[str, Files] = field(default_factory=dict)
    problems: dict[str, CaptureError] = field(default_factory=dict)
    left_over: list[str] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class _Way:
    """One way in which the frames of cameras lie: what there is by its name without suffix."""

    kind: str
    place: str
    entries: Mapping[str, str]
    """Name to compare with that of a camera -> name relative to the capture folder."""


def find_camera_frames(
    folder: Path, names: Sequence[str], *, follow_links: bool, named_in: Path, places: Sequence[str] = PLACES
) -> CameraFrames:
    """Frames of each camera that has some.

    What most cameras have decides: videos, folders of images (or of one video), or single images. Cameras without it
    may have one of the first two elsewhere, but never a single image among videos.

    Args:
        folder: Of the capture.
        names: Of the cameras.
        follow_links, named_in: See `place_in`.
        places: Folders to look in, relative to the capture's.
    """
    ways = [(way, match_names(names, list(way.entries))) for place in places for way in _ways(folder, place)]
    ways.sort(key=lambda pair: -len(pair[1]))  # stable: the order of places and kinds decides between equals
    found = CameraFrames()
    if not ways or not ways[0][1]:
        found.left_over.extend(name for way, _ in ways if way.kind == "video" for name in way.entries.values())
        return found
    best, best_match = ways[0]
    used = [ways[0]] if best.kind == "image" else [pair for pair in ways if pair[0].kind != "image"]
    for name in names:
        way, match = next((pair for pair in used if name in pair[1]), (None, {}))
        if way is None:
            continue
        try:
            relative = way.entries[match[name]]
            found.files[name] = _files(folder, relative, way.kind, follow_links=follow_links, named_in=named_in)
        except CaptureError as error:
            found.problems[name] = error.said_of(f"Camera {shown(name)}")
    for way, match in used if best.kind != "image" else ways:
        if way is best or (way.kind == "video" and not match):
            others = set(way.entries) - set((best_match if way is best else match).values())
            found.left_over.extend(way.entries[other] for other in sorted(others, key=natural_key))
    return found


def match_names(names: Sequence[str], candidates: Sequence[str]) -> dict[str, str]:
    """Which candidate belongs to which name: the same one, or the only one that people would call the same.

    Case, separators and leading zeros count as the same: cam1 and Cam_001.
    """
    exact = set(candidates)
    by_key: dict[str, list[str]] = {}
    for candidate in candidates:
        by_key.setdefault(plain_name(candidate), []).append(candidate)
    found = {name: name for name in names if name in exact}
    taken = set(found.values())
    wanted = Counter(plain_name(name) for name in names)
    for name in names:
        key = plain_name(name)
        others = [candidate for candidate in by_key.get(key, []) if candidate not in taken]
        if name not in found and len(others) == 1 and wanted[key] == 1:
            found[name] = others[0]
    return found


def missing_frames(names: Sequence[str], found: CameraFrames, path: Path) -> list[CaptureError]:
    """One problem that names all cameras for which there is nothing, and the problems of single ones.

    Args:
        names: Of all cameras.
        found: The files found.
        path: The file with the cameras.
    """
    problems = list(found.problems.values())
    missing = [shown(name) for name in names if name not in found.files and name not in found.problems]
    if missing:
        text = f"No frames found for {len(missing)} of {len(names)} cameras: {shortened(missing)}."
        if found.left_over:
            text += f" These belong to no camera: {shortened([shown(name) for name in found.left_over])}."
        hint = "Name each video or folder of images as its camera, or take the camera out of the calibration."
        problems.append(CaptureError(text, hint=hint, path=path))
    return problems


def _ways(folder: Path, place: str) -> Iterator[_Way]:
    """Videos, folders and images in one place; nothing where it is not there."""
    inside = folder / place if place else folder
    try:
        videos, folders, images = (
            listed(inside, VIDEO_SUFFIXES),
            folders_in(inside),
            listed(inside, IMAGE_SUFFIXES),
        )
    except OSError:
        return
    prefix = f"{place}/" if place else ""
    yield _Way("video", place, {os.path.splitext(name)[0]: prefix + name for name in reversed(videos)})
    yield _Way("folder", place, {name: prefix + name for name in folders if prefix + name not in PLACES})
    yield _Way("image", place, {os.path.splitext(name)[0]: prefix + name for name in reversed(images)})


def _files(folder: Path, relative: str, kind: str, *, follow_links: bool, named_in: Path) -> Files:
    if kind == "folder":
        return frames_in_folder(folder, relative, follow_links=follow_links, named_in=named_in)
    path = place_in(folder, relative, follow_links=follow_links, named_in=named_in)
    return path if kind == "video" else [path]
