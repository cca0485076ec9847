"""From offsets that were found to corrections of a capture; what it was corrected by before is counted in."""

from __future__ import annotations

import numpy as np

from engine.capture.capture import Capture
from engine.capture.formats import capture_json
from engine.capture.writers.capture_json import Corrections
from engine.storage.typed_json import to_type
from engine.synchronisation.solving import common_zero
from engine.synchronisation.synchronisation import Synchronisation


def present_offsets(capture: Capture) -> np.ndarray:
    """Offsets that a capture was opened with, in frames. [C] float64

    Raises:
        CaptureError: Its capture.json can no longer be read.
    """
    present = dict.fromkeys(capture.rig.names, 0.0)
    if (capture.path / capture_json.FILE).is_file():
        for row in capture_json.read_document(capture.path).cameras:
            camera = to_type(row, capture_json.CameraDocument)
            present[camera.name] = camera.offset_frames
    return np.array([present[name] for name in capture.rig.names])


def corrections_for(capture: Capture, found: Synchronisation) -> Corrections:
    """New offsets of all cameras; those whose offset is unknown keep theirs.

    Args:
        capture: As it was when they were measured.
        found: The offsets measured on it.
    """
    known = np.array([camera.source is not None for camera in found.cameras])
    present = present_offsets(capture)
    moved = present.round() + np.where(known, found.offsets_frames, 0.0)  # pictures were read at whole frames
    moved = np.where(known, moved, present)
    moved = np.round(moved - common_zero(moved), 2)
    return Corrections(offset_frames={name: float(o) for name, o in zip(capture.rig.names, moved, strict=True)})
