"""How much of what each camera sees others see too, and where neighbours stand far apart. Numbers only, no pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.camera.projection import is_in_picture, pixel_rays, project, projection_matrices, to_world
from engine.camera.rig import CameraRig
from engine.doctor.finding import Finding
from engine.doctor.neighbours import angles_deg
from engine.doctor.words import counted, listed

N_OTHERS = 2
"""Depth is safe where so many other cameras see a place."""
DEPTHS = (0.6, 0.8, 1.0, 1.3, 1.7)
"""At which places are looked at, as shares of the distance to what the rig looks at."""
GRID = 9
MAX_OTHERS = 40
"""Of more cameras so many nearest ones are asked whether they see a place."""
LOW_SHARE = 0.5
"""Share of a picture that others ought to see."""
WIDE_DEG = 32.0
"""Neighbours farther apart match badly."""


@dataclass(frozen=True, slots=True)
class CameraCoverage:
    """Of each camera.

    Attributes:
        shares: Of its picture that at least N_OTHERS other cameras see, 0 to 1. [C]
        nearest_deg: Angle to the nearest camera as seen from what the rig looks at. [C]
    """

    shares: np.ndarray
    nearest_deg: np.ndarray


def measure_coverage(rig: CameraRig) -> CameraCoverage:
    """Send rays through each picture and count who else sees places along them."""
    projections = projection_matrices(rig)
    distances = np.linalg.norm(rig.focus_point() - rig.centers, axis=1)
    shares = np.ones(len(rig))
    angles = angles_deg(rig)
    np.fill_diagonal(angles, np.inf)
    for camera in range(len(rig)):
        width, height = (int(value) for value in rig.image_sizes[camera])
        rays = pixel_rays(rig.Ks[camera], width, height)
        rows = np.linspace(0, height - 1, GRID).round().astype(int)
        columns = np.linspace(0, width - 1, GRID).round().astype(int)
        chosen = rays[rows][:, columns].reshape(-1, 3)
        places = np.concatenate([chosen * depth * distances[camera] for depth in DEPTHS])
        places = to_world(places, rig.world_to_camera[camera])
        n_seeing = np.zeros(len(places), dtype=np.int64)
        for other in np.argsort(angles[camera], kind="stable")[: min(MAX_OTHERS, len(rig) - 1)]:
            size = (int(value) for value in rig.image_sizes[other])
            n_seeing += is_in_picture(*project(places, projections[other]), *size)
        shares[camera] = float((n_seeing >= min(N_OTHERS, len(rig) - 1)).mean())
    return CameraCoverage(shares, angles.min(1) if len(rig) > 1 else np.full(1, np.inf))


def check_coverage(rig: CameraRig, coverage: CameraCoverage) -> list[Finding]:
    """Cameras that see what others do not, and gaps between neighbours."""
    if len(rig) < 2:
        text = "With only one camera, depth cannot be measured."
        return [Finding("coverage", "error", rig.names, (), text, 1.0, "Training needs at least two cameras.")]
    names = np.array(rig.names)
    found = []
    is_low = coverage.shares < LOW_SHARE
    if is_low.any():
        low = tuple(names[is_low].tolist())
        worst = int(coverage.shares.argmin())
        text = (
            f"{listed(low)} {counted(low, 'sees', 'see')} much that fewer than {N_OTHERS} others see: of "
            f"{names[worst]}'s picture {100 * coverage.shares[worst]:.0f} % is covered."
        )
        advice = "Expect little depth there. Turn these cameras towards the scene, or add cameras next to them."
        found.append(Finding("coverage", "note", low, (), text, 0.8, advice))
    is_far = coverage.nearest_deg > WIDE_DEG
    if is_far.any():
        far = tuple(names[is_far].tolist())
        widest = float(coverage.nearest_deg[is_far].max())
        how_far = f"up to {widest:.0f} degrees from the nearest other camera"
        if widest >= 180.0:
            how_far = "with no other camera facing the same way"
        text = f"{listed(far)} {counted(far, 'stands', 'stand')} {how_far}."
        advice = "Surfaces are hard to match over such angles. Cameras 10 to 20 degrees apart give the best depth."
        found.append(Finding("gaps", "note", far, (), text, 0.9, advice))
    return found
