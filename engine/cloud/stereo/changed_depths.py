"""Depth maps of a frame of which an earlier one is known: what looks as it did then keeps the depth that it had then.

Where the picture has changed, the frame is searched by itself: a sweep at half the working size finds where things
stand now, slanted patches refine it. The check by other cameras and the filling are done anew for the whole picture.
Letters: C cameras, H W full pictures, h w working pictures (about 160 x 90).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from engine.camera.rig import CameraRig
from engine.cloud.stereo.depth_scene import WORKING_PIXELS, DepthMaps, DepthScene, prepared, sweep_all
from engine.cloud.stereo.fill import HALF, enlarged
from engine.images.image_filters import block_mean, dilate

CHANGED_GREY_LEVELS = 5.0
"""Differences of working pixels that noise hardly reaches: they are means of many pixels."""
MARGIN_PX = 2
"""Patches around what has changed see it too."""


def changed_depth_maps(
    pictures: np.ndarray, is_stable: np.ndarray, rig: CameraRig, first: DepthMaps
) -> tuple[DepthMaps, np.ndarray]:
    """Depth maps of one frame.

    Args:
        pictures: [C, H, W, 3] uint8
        is_stable: Pixels that count. [C, H, W] bool
        rig: At the size of the pictures.
        first: Of the earlier frame of the same cameras.
    Returns:
        depth maps, in the depth range and with the first gains of the earlier frame's; and the pixels [C, h, w] that
        say something new: they have changed, or cameras agree only now.
    """
    greys, is_usable, _, _ = prepared(pictures, is_stable, rig, WORKING_PIXELS, first.scene.gains)
    scene = replace(first.scene, greys=greys, is_usable=is_usable)
    is_changed = (np.abs(greys - first.scene.greys) > CHANGED_GREY_LEVELS) | (is_usable != first.is_usable)
    is_changed = np.stack([dilate(changed, MARGIN_PX) for changed in is_changed])
    coarse = np.where(is_changed, _coarse_sweep(scene), first.measured)
    seeds = np.stack([coarse, first.measured])
    maps = DepthMaps.of(scene, scene.better(scene.refined(seeds, coarse, is_wanted=is_changed), coarse))
    return maps, is_changed | (maps.is_agreed & ~first.is_agreed)


def _coarse_sweep(scene: DepthScene) -> np.ndarray:
    """Inverse depths [C, h, w] by a sweep at half the working size."""
    height, width = scene.greys.shape[1:]
    size = np.array([[width // HALF * HALF, height // HALF * HALF]])
    rig = scene.rig
    cut = CameraRig(rig.names, rig.world_to_camera, rig.Ks, np.repeat(size, len(rig), axis=0))
    inverse, _ = sweep_all(
        np.stack([block_mean(grey, HALF) for grey in scene.greys]),
        np.stack([block_mean(usable, HALF) > 0.6 for usable in scene.is_usable]),
        cut.resized(cut.image_sizes // HALF),
        scene.sources,
        scene.near,
        scene.far,
    )
    return np.stack([enlarged(camera, height, width) for camera in inverse])
