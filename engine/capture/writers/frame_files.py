"""Frames of a capture put into another folder: copied, linked, or decoded into PNG files."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from PIL import Image

from engine.capture.frames import FrameSource, ImageFrames, IndexedFrames, VideoFrames
from engine.capture.layout.format_result import CameraEntry, Layout
from engine.errors import CaptureError
from engine.storage.files import check_regular

Frames = Literal["none", "link", "copy", "png"]
FRAMES: tuple[Frames, ...] = ("none", "link", "copy", "png")
"""The treatment of the frames: left where they are, linked to, copied as they are, or decoded into images."""
_UNFIT = re.compile(r'[\\/:*?"<>|%]')
Report = Callable[[int, int], None]


def safe_names(names: tuple[str, ...]) -> dict[str, str]:
    """For each camera a name that every file system takes as one part of a path; no two the same."""
    found: dict[str, str] = {}
    for name in names:
        safe = _UNFIT.sub("_", name).strip(". ") or "cam"
        taken = {other.lower() for other in found.values()}
        number = 2
        candidate = safe
        while candidate.lower() in taken:
            candidate, number = f"{safe}_{number}", number + 1
        found[name] = candidate
    return found


def with_frames_in(layout: Layout, folder: Path, frames: Frames, report: Report) -> Layout:
    """The layout with its frames in another folder: videos/<camera>.mp4 or images/<camera>/000000.png and so on.

    Frames of a video that are not taken one by one from its beginning are decoded, also where they are to be copied or
    linked: no other layout can say which they are.

    Args:
        folder: Must exist.
        frames: "none" leaves all as it is.
        report: Called with how many files are done, and of how many.
    Raises:
        CaptureError: A frame cannot be decoded.
        OSError: The disk refused, or a file is missing.
    """
    if frames == "none":
        return layout
    names = safe_names(tuple(entry.name for entry in layout.cameras))
    plans = [_Plan(entry, names[entry.name], folder, frames, layout.n_frames) for entry in layout.cameras]
    n_files, n_done = sum(plan.n_files for plan in plans), 0

    def count() -> None:
        nonlocal n_done
        n_done += 1
        report(n_done, n_files)

    # frames in a log curve were written as they are displayed
    return replace(layout, cameras=tuple(plan.carried_out(count) for plan in plans), curve=None)


class _Plan:
    """The work for one camera."""

    def __init__(self, entry: CameraEntry, name: str, folder: Path, frames: Frames, n_frames: int) -> None:
        self._entry, self._name, self._folder, self._frames = entry, name, folder, frames
        source, indices = plain_source(entry.source, n_frames)
        is_kept = frames != "png" and getattr(source, "curve", None) is None
        self._is_video = isinstance(source, VideoFrames) and indices is None and is_kept
        self._files: tuple[Path, ...] | None = None
        if isinstance(source, ImageFrames) and is_kept:
            rows = range(n_frames) if indices is None else indices
            self._files = tuple(source.files[int(row)] for row in rows)
        self.n_files = 1 if self._is_video else n_frames
        self._n_frames = n_frames

    def carried_out(self, count: Callable[[], None]) -> CameraEntry:
        """The camera with its frames in their new place."""
        entry = self._entry
        if self._is_video:
            path = self._folder / "videos" / f"{self._name}{entry.source.path.suffix.lower()}"
            self._put(entry.source.path, path)
            count()
            return replace(entry, source=VideoFrames(path, self._n_frames))
        folder = self._folder / "images" / self._name
        folder.mkdir(parents=True, exist_ok=True)
        if self._files is not None:
            paths = [folder / f"{row:06d}{path.suffix.lower()}" for row, path in enumerate(self._files)]
            for path, target in zip(self._files, paths, strict=True):
                self._put(path, target)
                count()
        else:
            paths = [folder / f"{row:06d}.png" for row in range(self._n_frames)]
            for path, picture in zip(paths, entry.source.read(range(self._n_frames)), strict=True):
                Image.fromarray(np.ascontiguousarray(picture)).save(path, format="PNG", compress_level=1)
                count()
            entry.source.close()
        return replace(entry, source=ImageFrames(folder, paths))

    def _put(self, path: Path, target: Path) -> None:
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            check_regular(path)
        except OSError as error:  # of the capture: not the fault of the folder that is written
            text = f"The file cannot be read ({error.strerror or error})."
            raise CaptureError(text, hint="Put it back.", path=path) from error
        if self._frames == "link":
            target.symlink_to(os.path.abspath(path))
        else:
            shutil.copyfile(path, target)


def plain_source(source: FrameSource, n_frames: int) -> tuple[FrameSource, np.ndarray | None]:
    """The files behind a source, and which of their frames it takes; None for the first `n_frames` one by one."""
    if not isinstance(source, IndexedFrames):
        return source, None
    inner, indices = plain_source(source.source, n_frames)
    taken = source.frame_indices if indices is None else indices[source.frame_indices]
    return inner, None if np.array_equal(taken, np.arange(n_frames)) else np.asarray(taken)


def name_in(path: Path, folder: Path) -> str:
    """A path as a file in `folder` names it: relative where it lies inside, else absolute."""
    absolute, root = os.path.abspath(path), os.path.abspath(folder)
    inside = os.path.commonpath((absolute, root)) == root
    return Path(os.path.relpath(absolute, root)).as_posix() if inside else absolute
