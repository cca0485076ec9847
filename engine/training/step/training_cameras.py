"""TrainingCameras: the cameras a clip is trained with, and how their poses and focal lengths learn with the model.

Moving a camera is the same as moving the scene in front of it, so the gradient of a pose follows from the gradients of
the Gaussians: no kernel knows of it. Where the focal length is concerned, the footprint of a Gaussian is taken to grow
evenly; the effect of its slant away from the picture's centre is left out.

The learned numbers are counted in pixels: by how much the picture moves at its middle and at a typical depth. So one
rate suits all seven numbers of all cameras, and their gradients are no larger than others.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from engine.camera.corrections import (
    LOG_FOCAL,
    N_VALUES,
    ROTATION,
    TRANSLATION,
    corrected,
    corrected_camera,
    turn,
)
from engine.camera.projection import focal_px
from engine.camera.rig import CameraRig
from engine.model.clip_view import View
from engine.model.host_array import host_array
from engine.raster.gaussians import Gaussians


class TrainingCameras:
    """Cameras of one training. Their corrections learn, or stay as they are.

    The gauge is fixed: a common movement, turn or scale of all cameras, and a common change of focal lengths, are taken
    out of the corrections, to first order. So cameras that were not trained on still fit the scene.

    Args:
        rig: The training cameras as the capture has them.
        near_plane: Nearest depth that is drawn, scene units.
        start: Corrections to begin with. [C, 7]
        is_learning: Whether they learn.
        like: A tensor of the device and type that parameters have.
    """

    def __init__(
        self, rig: CameraRig, *, near_plane: float, start: np.ndarray | None, is_learning: bool, like: Tensor
    ) -> None:
        self._original, self._near_plane = rig, near_plane
        self.is_learning = self._is_refined = is_learning
        self._units = _units(rig)
        values = np.zeros((len(rig), N_VALUES)) if start is None else start / self._units
        self.pixels = nn.Parameter(torch.from_numpy(values).to(like), requires_grad=is_learning)
        """Corrections in pixels. [C, 7]"""
        self._gauge = _gauge(rig, self._units)
        self._start = start
        self._views: dict[int, View] = {}
        self.first_views = self.views
        """Views of all cameras, as they were at first: the anchors that they may see are looked up once."""
        self._watched: Gaussians | None = None

    @property
    def corrections(self) -> np.ndarray | None:
        """As engine.camera.corrections has them; None where there are none. [C, 7] float32"""
        if not self._is_refined:
            return self._start
        return (host_array(self.pixels) * self._units).astype(np.float32)

    @property
    def kept(self) -> np.ndarray | None:
        """The corrections for a checkpoint, to the last bit; None where nothing was learned. [C, 7]"""
        return host_array(self.pixels).copy() if self._is_refined else None

    def freeze(self) -> None:
        """The corrections stay as they are from here on."""
        self.is_learning = False
        self.pixels.requires_grad = False

    def restore(self, kept: np.ndarray | None) -> None:
        """Inverse of `kept`. Raises ValueError where it does not fit."""
        if (kept is not None) != self._is_refined or (kept is not None and kept.shape != self.pixels.shape):
            raise ValueError("corrections of cameras do not fit the setting or the cameras")
        if kept is not None:
            with torch.no_grad():
                self.pixels.copy_(torch.from_numpy(kept))
            self._views.clear()

    @property
    def rig(self) -> CameraRig:
        """The cameras as they are by now."""
        return corrected(self._original, self._original.names, self.corrections)

    @property
    def views(self) -> list[View]:
        """Views of all cameras, as they are by now."""
        return [self.view(row) for row in range(len(self._original))]

    def view(self, row: int) -> View:
        """View of one camera, as it is by now."""
        if row not in self._views:
            pose, K = self._original.world_to_camera[row], self._original.Ks[row]
            if self.corrections is not None:
                pose, K = corrected_camera(pose, K, self._of(row))
            width, height = (int(side) for side in self._original.image_sizes[0])
            self._views[row] = View.from_arrays(pose, K, width=width, height=height, near_plane=self._near_plane)
        return self._views[row]

    def watch(self, gaussians: Gaussians) -> None:
        """Keep the gradients of Gaussians that are about to be drawn."""
        if self.is_learning and gaussians.means.requires_grad:
            for tensor in (gaussians.means, gaussians.quats, gaussians.scales):
                tensor.retain_grad()
            self._watched = gaussians

    def take_gradient(self, row: int) -> None:
        """Take one camera's gradient, after the backward pass of a picture of it."""
        watched, self._watched = self._watched, None
        if watched is None or watched.means.grad is None:
            return
        values = self._of(row)
        pose, _ = corrected_camera(self._original.world_to_camera[row], self._original.Ks[row], values)
        gradient = np.zeros((len(self._units), N_VALUES))
        gradient[row] = correction_gradient(watched, pose, values) * self._units[row]
        self.pixels.grad = torch.from_numpy(gradient).to(self.pixels)

    def settle(self) -> None:
        """After a step: back into the gauge, and the pictures follow."""
        if not self.is_learning:
            return
        values = host_array(self.pixels).astype(np.float64).reshape(-1)
        values -= self._gauge @ (self._gauge.T @ values)
        with torch.no_grad():
            self.pixels.copy_(torch.from_numpy(values.reshape(-1, N_VALUES)))
        self._views.clear()

    def _of(self, row: int) -> np.ndarray:
        """Correction of one camera. [7] float64"""
        values = self.corrections
        return np.zeros(N_VALUES) if values is None else values[row].astype(np.float64)


def correction_gradient(gaussians: Gaussians, pose: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Derivatives of a loss by the correction of the camera it was seen through. [7] float64

    Args:
        gaussians: With gradients of means, quats and scales.
        pose: World to camera with the correction. [4, 4]
        values: The correction. [7]
    """
    tensors = (gaussians.means, gaussians.quats, gaussians.scales)
    means, quats, scales = (host_array(tensor).astype(np.float64) for tensor in tensors)
    by_mean, by_quat, by_scale = (_gradient(tensor) for tensor in tensors)
    rotation, translation = pose[:3, :3], pose[:3, 3]
    force = rotation @ by_mean.sum(0)
    # camera coordinates by gradients in camera axes, summed; without BLAS, whose sums depend on its threads
    moments = rotation @ np.einsum("ni,nj->ij", means, by_mean) @ rotation.T + np.outer(translation, force)
    torque = np.array([moments[1, 2] - moments[2, 1], moments[2, 0] - moments[0, 2], moments[0, 1] - moments[1, 0]])
    w, u, by_w, by_u = quats[:, :1], quats[:, 1:], by_quat[:, :1], by_quat[:, 1:]
    spin = 0.5 * (w * by_u - by_w * u + np.cross(u, by_u)).sum(0)  # the Gaussians turn about themselves
    gradient = np.zeros(N_VALUES)
    # turned about the camera's centre as it was before the translation
    gradient[ROTATION] = turn(values[ROTATION])[1].T @ (torque - np.cross(values[TRANSLATION], force) + rotation @ spin)
    gradient[TRANSLATION] = force
    gradient[LOG_FOCAL] = moments[0, 0] + moments[1, 1] + (scales * by_scale).sum()
    return gradient


def _gradient(tensor: Tensor) -> np.ndarray:
    """Gradient of a tensor that was drawn; zeros where no pixel showed it. float64"""
    return np.zeros(tensor.shape) if tensor.grad is None else host_array(tensor.grad).astype(np.float64)


def _units(rig: CameraRig) -> np.ndarray:
    """The size of one pixel in each number of each camera's correction. [C, 7]"""
    pixel = 1.0 / focal_px(rig.Ks)
    units = np.repeat(pixel[:, None], N_VALUES, axis=1)
    units[:, TRANSLATION] *= np.linalg.norm(rig.centers - rig.focus_point(), axis=1)[:, None]
    return units


def _gauge(rig: CameraRig, units: np.ndarray) -> np.ndarray:
    """Changes of all cameras that no picture shows, or hardly: orthonormal columns, in pixels. [7 C, 8]

    The scene may turn, move and grow without any change of the pictures, to first order; and a common factor of all
    focal lengths is nearly a change of all distances.
    """
    columns = np.zeros((len(rig), N_VALUES, 8))
    for camera, pose in enumerate(rig.world_to_camera):
        rotation, translation = pose[:3, :3], pose[:3, 3]
        columns[camera, ROTATION, 0:3] = -rotation
        columns[camera, TRANSLATION, 0:3] = np.cross(rotation, translation, axisa=0, axisb=0, axisc=0)
        columns[camera, TRANSLATION, 3:6] = -rotation
        columns[camera, TRANSLATION, 6] = translation
        columns[camera, LOG_FOCAL, 7] = 1.0
    return np.linalg.qr((columns / units[:, :, None]).reshape(-1, 8))[0]
