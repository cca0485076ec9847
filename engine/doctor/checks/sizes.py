"""Calibrations that look made for pictures of another size: a principal point far from the middle, odd pixels."""

from __future__ import annotations

import numpy as np

from engine.capture.capture import Capture
from engine.doctor.finding import Finding
from engine.doctor.words import counted, listed

OFF_MIDDLE = 0.15
"""Share of the width or height; lenses sit straighter than that."""
SQUARE = 0.04
"""Share by which pixels may be wider than high."""


def check_sizes(capture: Capture) -> list[Finding]:
    """Compare each camera's numbers with the size of its pictures."""
    rig = capture.native_rig
    found = []
    off = np.abs(rig.Ks[:, :2, 2] / rig.image_sizes - 0.5)
    is_off = (off > OFF_MIDDLE).any(1)
    ratio = rig.Ks[:, 0, 0] / rig.Ks[:, 1, 1]
    is_wide = np.abs(np.log(ratio)) > np.log1p(SQUARE)
    if is_off.any():
        names = tuple(np.array(rig.names)[is_off].tolist())
        text = (
            f"The optical axis of {listed(names)} lies up to {100 * float(off.max()):.0f} % of the picture's size off "
            "its centre."
        )
        found.append(_finding(names, text))
    if is_wide.any():
        names = tuple(np.array(rig.names)[is_wide].tolist())
        most = 100 * float(np.expm1(np.abs(np.log(ratio[is_wide])).max()))
        text = f"Pixels of {listed(names)} {counted(names, 'is', 'are')} up to {most:.0f} % off from square."
        found.append(_finding(names, text.replace("Pixels of", "The pixel shape of")))
    return found


def _finding(names: tuple[str, ...], text: str) -> Finding:
    advice = "Check that the calibration was made at this picture size, with no later cropping or stretching."
    return Finding("image size", "warning", names, (), text, 0.6, advice)
