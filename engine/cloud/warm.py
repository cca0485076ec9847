"""Compile, or load from the cache, every kernel that builds clouds."""

from __future__ import annotations

import numpy as np

from engine.camera.projection import projection_matrices
from engine.camera.rig import CameraRig
from engine.cloud.background.background import estimate_background
from engine.cloud.background.exposure import Exposure
from engine.cloud.background.light import AnchorLight
from engine.cloud.background.masks import motion_mask
from engine.cloud.motion.hull import Grid, carve, hull_colors, hull_visibility
from engine.cloud.stereo.depth.consistency import check_depths
from engine.cloud.stereo.depth.slanted import refine_slanted
from engine.cloud.stereo.depth.smoothing import smooth_inverse_depth
from engine.cloud.stereo.depth.sweep import matching_costs
from engine.images.image_filters import dilate
from engine.images.remap import remap

_SIZE_PX = 16


def warm_up() -> None:
    """Run every kernel once on pictures of a few pixels, with the types and layouts of a real preparation.

    About five seconds of one core when nothing is cached (holding the interpreter lock), a fraction of a second after.
    """
    rng = np.random.default_rng(0)
    rig = _two_cameras()
    frames = rng.integers(0, 255, (3, _SIZE_PX, _SIZE_PX, 3)).astype(np.uint8)
    AnchorLight(np.full((3, 3), 2.0), rig, frames[:2]).at(lambda row: [frames[row]])
    background = estimate_background(Exposure.of_frames(frames).applied_to(frames))
    motion_mask(frames[0], background.image)
    motion_mask(background.image, frames[0].astype(np.float32))
    dilate(~background.is_stable, 1)
    for n_sub in (1, 2):
        lattice, is_valid = np.zeros((4, 4, 2), np.float32), np.ones((_SIZE_PX, _SIZE_PX), bool)
        remap(frames[0], lattice, _SIZE_PX, (_SIZE_PX, _SIZE_PX), n_sub, is_valid)

    planes = np.linspace(0.2, 1.0, 4, dtype=np.float32)
    greys = frames[:2].mean(-1).astype(np.float32)
    is_usable = np.ones(greys.shape, dtype=bool)
    costs = matching_costs(greys, is_usable, rig, camera=0, sources=[1], inverse_depths=planes)
    smooth_inverse_depth(costs, greys[0], planes)
    prior = np.full(greys[0].shape, 0.5)
    refine_slanted(greys, is_usable, rig, camera=0, sources=[1], seeds=prior[None], prior=prior, low=0.2, high=1.0)
    check_depths(np.full(greys.shape, 2.0), rig, camera=0, others=[1], tolerance=0.01)

    grid, projections = Grid.over(np.array([-0.4, -0.4, 1.6]), np.array([0.4, 0.4, 2.4]), 0.1), projection_matrices(rig)
    voxels = carve(is_usable, projections, grid, near=0.1, n_misses=0, min_hits=1)
    pixel, is_visible = hull_visibility(grid.centers(voxels), grid.size, is_usable, projections, near=0.1)
    hull_colors(frames[:2], pixel, is_visible, np.ones((2, 3)))


def _two_cameras() -> CameraRig:
    """Two cameras side by side that look along z."""
    poses = np.stack([np.eye(4), np.eye(4)])
    poses[1, 0, 3] = -0.1
    half = _SIZE_PX / 2
    K = np.array([[_SIZE_PX, 0.0, half], [0.0, _SIZE_PX, half], [0.0, 0.0, 1.0]])
    return CameraRig(("left", "right"), poses, np.stack([K, K]), np.full((2, 2), _SIZE_PX, dtype=np.int64))
