"""Cameras that stand nearly in the same place and look the same way: they see nothing that one of them does not."""

from __future__ import annotations

import numpy as np

from engine.camera.rig import CameraRig
from engine.capture.cameras.rig_checks import rig_extent
from engine.capture.writers.capture_json import Corrections
from engine.doctor.finding import Finding, PairEvidence

NEAR_SHARE = 0.004
"""Distance as a share of the rig's extent."""
ALIKE_DEG = 2.0


def check_twins(rig: CameraRig) -> list[Finding]:
    """Compare every two cameras."""
    if len(rig) < 3:
        return []
    extent, centers, forwards = rig_extent(rig), rig.centers, rig.forwards
    found = []
    for row in range(len(rig) - 1):
        apart = np.linalg.norm(centers[row + 1 :] - centers[row], axis=1)
        cosines = np.clip(forwards[row + 1 :] @ forwards[row], -1.0, 1.0)
        is_twin = (apart < NEAR_SHARE * extent) & (np.degrees(np.arccos(cosines)) < ALIKE_DEG)
        for other in np.flatnonzero(is_twin) + row + 1:
            name, second = rig.names[row], rig.names[int(other)]
            share = 100 * float(apart[other - row - 1]) / extent
            found.append(
                Finding(
                    kind="twins",
                    severity="warning",
                    cameras=(name, second),
                    frames=(),
                    text=f"{name} and {second} stand {share:.2g} % of the rig's extent apart and look the same way.",
                    certainty=0.9,
                    advice="If one of them was listed twice, leave it out; otherwise check their calibration.",
                    fix=Corrections(is_excluded={second: True}),
                    evidence=(PairEvidence(name, second, 0, "nearly the same view"),),
                )
            )
    return found
