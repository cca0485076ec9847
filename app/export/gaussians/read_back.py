"""ReadBack: what an exported file of Gaussians gives back is compared with the live scene, from capture cameras."""

from __future__ import annotations

import numpy as np
import torch

from app.export.scene_frames import SceneFrames
from engine.camera.rig import CameraRig
from engine.export.splats import Splats
from engine.export.world import FileWorld
from engine.images.psnr import psnr
from engine.model.clip_view import render_gaussians
from engine.raster.gaussians import Gaussians

N_CAMERAS = 3
LONGEST_SIDE_PX = 960
"""Pictures are compared at this size at most, so that measuring takes less time than writing."""


class ReadBack:
    """Measures files of one export.

    Args:
        scene: The source of its frames.
        world: The scene's placement in the file; undone here.
    """

    def __init__(self, scene: SceneFrames, world: FileWorld) -> None:
        self._scene, self._world = scene, world
        rig = scene.opened.capture.rig  # each clip corrects it as it was trained
        self._rig = _reduced(rig.subset(np.unique(np.linspace(0, len(rig) - 1, N_CAMERAS).round().astype(int))))

    def psnr_db(self, splats: Splats, frame: float, live: Gaussians) -> dict[str, float]:
        """PSNR of the picture of a file against the live one, by the name of the camera. Nothing but Gaussians: black
        behind them, and no camera's own colours.

        Args:
            splats: As they were read.
            frame: Of the capture.
            live: What was written.
        """
        found = self._world.returned(splats).gaussians()
        trained = self._scene.trained(frame)
        figures = {}
        for camera, name in enumerate(self._rig.names):
            view = trained.view(self._rig, camera)
            with torch.no_grad():
                image, truth = (
                    render_gaussians(shown, view, backend=trained.model.backend).image[0].numpy()
                    for shown in (found, live)
                )
            figures[name] = round(psnr(image, np.clip(truth, 0.0, 1.0)), 2)
        return figures


def _reduced(rig: CameraRig) -> CameraRig:
    longest = rig.image_sizes.max(1, keepdims=True)
    sizes = np.round(rig.image_sizes * np.minimum(1.0, LONGEST_SIDE_PX / longest)).astype(np.int64)
    return rig.resized(np.maximum(sizes, 1))
