"""A calibration as a capture: capture.json in the folder of the videos, or in another one that names them there."""

from __future__ import annotations

import os
from pathlib import Path

from engine.calibration.calibrated import Calibration
from engine.calibration.videos import common_length, common_rate, find_videos
from engine.capture.formats.capture_json import FILE
from engine.capture.layout.format_result import CameraEntry, Layout
from engine.capture.writers.capture_json import capture_document, write_capture_json
from engine.errors import CaptureError


def check_target(out: Path, *, is_replacing: bool) -> None:
    """Refuse a folder that has a capture.json already, or cannot be one, before any work is done.

    Raises:
        CaptureError: Says which.
    """
    if out.exists() and not out.is_dir():
        raise CaptureError("This is a file; a capture is a folder.", hint="Name another folder.", path=out)
    if (out / FILE).exists() and not is_replacing:
        raise CaptureError(f"There is a {FILE} already.", hint="Name another folder, or allow replacing it.", path=out)


def write_calibrated(
    calibration: Calibration, videos: Path, out: Path, *, keeps_doubtful: bool = False, follow_links: bool = False
) -> bool:
    """Write capture.json into `out`. Whether the capture has to be opened with follow_links.

    Args:
        calibration: Cameras whose places cannot be trusted are written as excluded.
        videos: What was calibrated.
        out: Folder that becomes the capture.
        keeps_doubtful: Leave those in use.
        follow_links: Whether links in the folder of the videos may lead out of it.
    Raises:
        DiskError: The folder cannot be written.
    """
    found = calibration.found
    sources = {video.name: video for video in find_videos(videos, follow_links=follow_links)}
    rig = found.rig
    used = [sources[name] for name in rig.names]
    entries = [
        CameraEntry(name, rig.Ks[row], rig.world_to_camera[row], used[row].size, used[row].source, found.lenses[row])
        for row, name in enumerate(rig.names)
    ]
    layout = Layout(format=FILE, cameras=tuple(entries), n_frames=common_length(used), fps=common_rate(used))
    out.mkdir(parents=True, exist_ok=True)
    document = capture_document(layout, out)
    document["up"] = [0.0, 0.0, 1.0]
    for camera, doubt in zip(document["cameras"], found.doubts, strict=True):
        if doubt and not keeps_doubtful:
            camera["is_excluded"] = True
    write_capture_json(out, document)
    root = os.path.abspath(out)
    return follow_links or os.path.commonpath((os.path.abspath(videos), root)) != root
