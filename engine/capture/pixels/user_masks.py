"""Masks of moving parts, next to a capture: masks/<camera>/ with an image a frame, or a video masks/<camera>.mp4.

They are found here for every layout; capture.json may name others. White moves. A mask belongs to the frame at its
place in natural order, so there must be as many as the camera has frames; they may be smaller than the frames.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from engine.capture.files.frame_files import IMAGE_SUFFIXES, VIDEO_SUFFIXES, images_in, listed
from engine.capture.files.media import read_image_header, read_video_header
from engine.capture.files.places import place_in
from engine.capture.frames import FrameSource, ImageFrames, IndexedFrames, VideoFrames
from engine.capture.layout.format_checks import raise_problems, shortened
from engine.capture.layout.format_result import CameraEntry, Layout
from engine.errors import CaptureError

FOLDER = "masks"
ASPECT_TOLERANCE = 0.02
"""Share by which the sides of masks and frames may differ in proportion: masks of 427 x 240 for 1280 x 720."""


def with_masks(layout: Layout, folder: Path, *, follow_links: bool) -> Layout:
    """A capture with the masks that lie next to it, and with their oddities among its warnings.

    Raises:
        CaptureError: Masks that the capture itself names are fewer than its frames.
    """
    raise_problems([problem for entry in layout.cameras if (problem := _lacking(entry, layout.n_frames))], folder)
    root = folder / FOLDER
    if not root.is_dir():
        return layout
    entries, found, said = [], [], list(layout.warnings)
    for entry in layout.cameras:
        masks = None
        if entry.masks is None:
            try:
                masks = _beside(entry, folder, follow_links=follow_links)
            except (CaptureError, OSError) as error:
                reason = error.message if isinstance(error, CaptureError) else f"{error.strerror}."
                said.append(f'The masks of camera "{entry.name}" are not used: {reason}')
        if masks is not None:
            found.append(entry.name)
        entries.append(entry if masks is None else replace(entry, masks=masks))
    n_cameras = len(entries)
    if found:
        which = f"all {n_cameras} cameras" if len(found) == n_cameras else f"{len(found)} of {n_cameras} cameras"
        said.append(f"{FOLDER}/ has motion masks for {which}: {shortened(found)}.")
    elif len(said) == len(layout.warnings) and all(entry.masks is None for entry in entries):
        names = shortened([entry.name for entry in entries])
        said.append(f"The folder {FOLDER} has no masks for any camera; expected folders are {names}.")
    return replace(layout, cameras=tuple(entries), warnings=tuple(said))


def _beside(entry: CameraEntry, folder: Path, *, follow_links: bool) -> FrameSource | None:
    """The masks of one camera. None where there are none.

    Raises:
        CaptureError, OSError: They cannot be used.
    """
    root, source = folder / FOLDER, entry.source
    own = root / entry.name
    masks: FrameSource
    if own.is_dir():
        names = listed(own, IMAGE_SUFFIXES)
        if not names:
            return None
        files = images_in(folder, f"{FOLDER}/{entry.name}", names, follow_links=follow_links, named_in=own)
        masks, size = ImageFrames(own, files), read_image_header(files[0]).size
    else:
        videos = [name for name in listed(root, VIDEO_SUFFIXES) if Path(name).stem == entry.name]
        if not videos:
            return None
        video = place_in(folder, f"{FOLDER}/{videos[0]}", follow_links=follow_links, named_in=root)
        header = read_video_header(video)
        masks, size = VideoFrames(video, header.n_frames), header.size
    is_indexed = isinstance(source, IndexedFrames)
    n_frames = source.source.n_frames if is_indexed else source.n_frames
    if masks.n_frames != n_frames:
        text = f"there are {masks.n_frames} of them for {n_frames} frames."
        raise CaptureError(text, hint="Give one mask for each frame.", path=own)
    if abs(size[0] * entry.image_size[1] / (size[1] * entry.image_size[0]) - 1.0) > ASPECT_TOLERANCE:
        text = f"they are {size[0]}x{size[1]}, the frames {entry.image_size[0]}x{entry.image_size[1]}."
        raise CaptureError(text, hint="Export masks of the frames as they are stored.", path=own)
    return IndexedFrames(masks, source.frame_indices) if is_indexed else masks


def _lacking(entry: CameraEntry, n_frames: int) -> CaptureError | None:
    """The problem with masks that a capture names."""
    masks = entry.masks
    if masks is None:
        return None
    has = masks.source.n_frames if isinstance(masks, IndexedFrames) else masks.n_frames
    needed = int(np.max(masks.frame_indices)) + 1 if isinstance(masks, IndexedFrames) else n_frames
    if has >= needed:
        return None
    text = f'Camera "{entry.name}" has {has} masks for {needed} frames.'
    return CaptureError(text, hint="Give one mask for each frame, or take the masks out.", path=masks.path)
