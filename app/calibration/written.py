"""A calibration as a capture: capture.json in the folder of the videos, or in another one that names them there."""

from __future__ import annotations

import os
from pathlib import Path

from engine.calibration.calibrated import Calibration
from engine.calibration.videos import common_length, common_rate, find_videos
from engine.capture.format_result import CameraEntry, Layout
from engine.capture.formats.capture_json import FILE
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
        raise CaptureError(
            f"There is a {FILE} already.", hint="Name another folder, or say that it may be replaced.", path=out
        )


def write_calibrated(calibration: Calibration, videos: Path, out: Path) -> bool:
    """Write capture.json into `out`. Whether the capture has to be opened with follow_links.

    Raises:
        DiskError: The folder cannot be written.
    """
    found, sources = calibration.found, {video.name: video for video in find_videos(videos)}
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
    write_capture_json(out, document)
    root = os.path.abspath(out)
    return os.path.commonpath((os.path.abspath(videos), root)) != root
