"""Depth maps of a frame of which an earlier one is known: what looks as it did then keeps the depth that it had then.

Where the picture has changed, the frame is searched by itself, by the same sweep and the same slanted patches as the
earlier one. The check by other cameras and the filling are done anew for the whole picture.
Letters: C cameras, H W full pictures, h w working pictures (about 160 x 90).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from engine.camera.rig import CameraRig
from engine.cloud.stereo.depth.depth_scene import WORKING_PIXELS, DepthMaps, prepared, sweep_all
from engine.images.image_filters import dilate

CHANGED_GREY_LEVELS = 5.0
"""Differences of working pixels that noise hardly reaches: they are means of many pixels."""
N_SCANS = 3
"""One pass less than for a whole picture: what has not changed around a place is right from the beginning."""
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
    known = np.where(is_changed, np.nan, 1.0 / first.depths)
    swept, _ = sweep_all(greys, is_usable, scene.rig, scene.sources, scene.near, scene.far, known=known)
    swept = np.where(is_changed, swept, first.measured)
    seeds = np.stack([swept, first.measured])
    refined = scene.refined(seeds, swept, is_wanted=is_changed, n_scans=N_SCANS)
    maps = DepthMaps.of(scene, scene.better(refined, swept))
    return maps, is_changed | (maps.is_agreed & ~first.is_agreed)
