"""Masks that lie in the capture and are not used."""

from __future__ import annotations

from engine.capture.capture import Capture
from engine.capture.files.frame_files import IMAGE_SUFFIXES
from engine.capture.writers.capture_json import Corrections
from engine.doctor.finding import Finding

FOLDER = "masks"


def check_masks(capture: Capture) -> list[Finding]:
    """Look for images in masks/CAMERA, as many as the camera has frames."""
    found: dict[str, str] = {}
    for entry in capture.layout.cameras:
        folder = capture.path / FOLDER / entry.name
        if entry.masks is not None or not folder.is_dir():
            continue
        kinds = [path.suffix for path in sorted(folder.iterdir()) if path.suffix.lower() in IMAGE_SUFFIXES]
        for kind in dict.fromkeys(kinds):
            if kinds.count(kind) == entry.source.n_frames:
                found[entry.name] = f"{FOLDER}/{entry.name}/*{kind}"
                break
    if not found:
        return []
    text = f"Motion masks of {len(found)} of {len(capture.rig)} cameras are not used."
    advice = "Use them, so that motion is known rather than estimated."
    return [Finding("masks", "note", tuple(found), (), text, 0.9, advice, Corrections(masks=found))]
