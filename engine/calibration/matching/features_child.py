"""The process that looks for the key points of one camera.

pycolmap keeps the interpreter to itself for the seconds that one picture takes: in one process cameras would wait for
each other, and nothing could be reported meanwhile. Never imported by the program.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from engine.calibration.matching.features import extract
from engine.calibration.matching.pictures import CameraPictures, MovingPart
from engine.children.child import Parent
from engine.features.child_side import answer
from engine.progress import Progress


def look(arrays: dict[str, np.ndarray], folder: Path) -> dict[str, np.ndarray]:
    """Answer what engine.calibration.matching.feature_processes asks."""
    parts = [
        MovingPart(int(moment), arrays[f"picture{row}"], (int(corner[0]), int(corner[1])), arrays[f"is_moving{row}"])
        for row, (moment, corner) in enumerate(zip(arrays["moments"], arrays["corners"], strict=True))
    ]
    is_thorough = bool(arrays["is_thorough"])
    found = extract(CameraPictures(arrays["background"], tuple(parts)), is_thorough=is_thorough)
    return {"pixels": found.pixels, "moments": found.moments, "descriptors": found.descriptors}


def main(shared: Path, parent: Parent[Progress]) -> None:
    """Runs in the child."""
    answer(shared, look)
