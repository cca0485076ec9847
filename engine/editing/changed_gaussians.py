"""The effects of edits on Gaussians, in place and colour. Whatever is not finite stays where it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from engine.camera.rotations import matrices_of
from engine.editing.actions import Expose, Recolor, Transform
from engine.images.srgb import encoded_of, linear_of
from engine.model.host_array import host_array
from engine.raster.gaussians import Gaussians

LUMA = (0.2126, 0.7152, 0.0722)
"""Shares of red, green and blue in the grey of a display-encoded colour."""


def transformed(gaussians: Gaussians, is_chosen: Tensor, action: Transform) -> Gaussians:
    """Chosen Gaussians scaled and turned about a pivot, then moved."""
    means, quats, scales = gaussians.means.clone(), gaussians.quats.clone(), gaussians.scales.clone()
    pivot, quat = means.new_tensor(action.pivot, dtype=torch.float64), _unit(action.quat)
    matrix = torch.from_numpy(action.scale * matrices_of(quat)).to(means.device)
    offset = pivot + means.new_tensor(action.translation, dtype=torch.float64)
    means[is_chosen] = ((means[is_chosen].double() - pivot) @ matrix.T + offset).to(means.dtype)
    quats[is_chosen] = turned(quat, quats[is_chosen])
    scales[is_chosen] *= action.scale
    return replace(gaussians, means=means, quats=quats, scales=scales)


def turned(quat: np.ndarray, quats: Tensor) -> Tensor:
    """Quaternions, of any length, followed by one of unit length. [n, 4]"""
    w, x, y, z = (float(value) for value in quat)
    columns = [[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]]  # of the product with another
    return (quats.double() @ torch.tensor(columns, dtype=torch.float64, device=quats.device).T).to(quats.dtype)


def recolored(colors: Tensor, action: Recolor | Expose) -> Tensor:
    """Colours of chosen Gaussians, in 0..1. [n, 3]"""
    if isinstance(action, Expose):
        light = linear_of(np.maximum(host_array(colors).astype(np.float64), 0.0)) * 2.0**action.stops
        return torch.from_numpy(encoded_of(light)).to(colors.device, colors.dtype).clamp(0.0, 1.0)
    mixed = colors + action.tint_share * (colors.new_tensor(action.tint) - colors)
    grey = (mixed @ colors.new_tensor(LUMA))[:, None]
    return ((grey + action.saturation * (mixed - grey)) * colors.new_tensor(action.gains)).clamp(0.0, 1.0)


def faded(opacities: Tensor, is_chosen: Tensor, action: Recolor) -> Tensor:
    """All opacities, those of chosen Gaussians times that of the action, in 0..1. [N]"""
    return torch.where(is_chosen, (opacities * action.opacity).clamp(0.0, 1.0), opacities)


def _unit(quat: tuple[float, ...]) -> np.ndarray:
    values = np.asarray(quat, np.float64)
    return values / np.linalg.norm(values)
