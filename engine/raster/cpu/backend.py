"""The fast back end: kernels in order, and their place in autograd.

records (project) -> depth order (sort) -> tile lists (binning) -> pixels (blend); backward: replay of the tiles
(blend_backward) -> gradients (project_backward). Sources of the method: 3D Gaussian Splatting (Kerbl et al. 2023) for
the image formation; the rest is explained where it is done.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numba import get_num_threads
from torch import Tensor

from engine.raster.cpu import binning, blend, blend_backward, project, project_backward, sort
from engine.raster.cpu.camera_row import camera_row
from engine.raster.cpu.record import PAIR_FLOATS, RECORD_FLOATS, TILE
from engine.raster.cpu.threads import parallel_guard
from engine.raster.cpu.tile import SCRATCH_FLOATS
from engine.raster.cpu.workspace import Workspace, WorkspacePool
from engine.raster.gaussians import Gaussians
from engine.raster.rendering import Rendering
from engine.raster.view import PinholeView

_NONE_FROZEN = np.zeros(0, np.bool_)

POOL = WorkspacePool()
"""Idle buffers of this process."""

_MAX_PAIRS = 2**31 - 1
_EARLY_AND_LATE = "unsorted, then pair_sums"
"""Unsorted records are done with before the backward pass begins; its largest buffer takes their place."""


@dataclass(slots=True)
class _Drawing:
    """One rendered view and everything its backward pass needs. Arrays live in `workspace`."""

    workspace: Workspace
    camera: np.ndarray
    n_kept: int
    n_pairs: int
    n_trained: int
    n_columns: int
    order: np.ndarray
    records: np.ndarray
    tile_starts: np.ndarray
    trained: np.ndarray
    pairs_of_record: np.ndarray
    record_starts: np.ndarray
    pair_records: np.ndarray
    pairs_by_record: np.ndarray
    pair_blocks: np.ndarray


def rasterize_cpu(gaussians: Gaussians, views: list[PinholeView], background: Tensor, want_means2d: bool) -> Rendering:
    """Render every view. Arguments are those of `rasterize`, already checked; float32 on the cpu."""
    parameters = [tensor.contiguous() for tensor in gaussians.tensors()]
    is_frozen = _NONE_FROZEN if gaussians.is_frozen is None else gaussians.is_frozen.contiguous().numpy()
    background = background.contiguous()
    means2d = torch.zeros(len(views), len(gaussians), 2) if want_means2d else None
    is_recorded = torch.is_grad_enabled() and (
        want_means2d or background.requires_grad or any(tensor.requires_grad for tensor in parameters)
    )
    if means2d is not None:
        means2d.requires_grad_(is_recorded)
    images, alphas = [], []
    for index, view in enumerate(views):
        if is_recorded:
            centers = None if means2d is None else means2d[index]
            image, alpha = _Rasterize.apply(view, is_frozen, centers, background, *parameters)  # pyright: ignore
        else:
            with parallel_guard():
                image, transmittance, drawing = _draw(view, is_frozen, background, parameters)
            if means2d is not None:
                _write_centers(drawing, means2d[index])
            POOL.give_back(drawing.workspace)
            alpha = 1.0 - transmittance[..., None]
        images.append(image)
        alphas.append(alpha)
    if len(views) == 1:
        return Rendering(images[0][None], alphas[0][None], means2d)
    return Rendering(torch.stack(images), torch.stack(alphas), means2d)


class _Rasterize(torch.autograd.Function):
    """One view. Gradients for the centres, the background and the five parameters."""

    @staticmethod
    def forward(
        ctx: Any,
        view: PinholeView,
        is_frozen: np.ndarray,
        centers: Tensor | None,
        background: Tensor,
        *parameters: Tensor,
    ):
        with parallel_guard():
            image, transmittance, drawing = _draw(view, is_frozen, background, parameters)
        if centers is not None:
            _write_centers(drawing, centers)
        ctx.drawing = drawing
        ctx.save_for_backward(POOL.lease(drawing.workspace), image, transmittance, *parameters)
        return image, 1.0 - transmittance[..., None]

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, grad_image: Tensor, grad_alpha: Tensor):  # pyright: ignore[reportIncompatibleMethodOverride]
        _lease, image, transmittance, *parameters = ctx.saved_tensors
        _, _, needs_centers, needs_background, *needs_parameters = ctx.needs_input_grad
        grad_background = (grad_image * transmittance[..., None]).sum(dim=(0, 1)) if needs_background else None
        if not needs_centers and not any(needs_parameters):
            return None, None, None, grad_background, *[None] * len(parameters)
        with parallel_guard():
            grads, grad_centers = _differentiate(
                ctx.drawing, parameters, image, transmittance, grad_image.contiguous(), -grad_alpha[..., 0]
            )
        return None, None, grad_centers if needs_centers else None, grad_background, *grads


def _draw(view: PinholeView, is_frozen: np.ndarray, background: Tensor, parameters: Sequence[Tensor]):
    """Image [H, W, 3], transmittance [H, W] and the state for a backward pass."""
    workspace = POOL.take()
    means, quats, scales, opacities, colors = (tensor.detach().numpy() for tensor in parameters)
    n_rows = len(means)
    n_threads = get_num_threads()
    camera = camera_row(view)
    n_columns, n_tile_rows = -(-view.width // TILE), -(-view.height // TILE)
    n_tiles = n_columns * n_tile_rows

    n_padded = -(-max(n_rows, 1) // 16) * 16
    unsorted = workspace.array(_EARLY_AND_LATE, (n_padded, RECORD_FLOATS), np.float32)
    depths = workspace.array("depths", (n_padded,), np.float32)
    if n_rows:
        project.project(means, quats, scales, opacities, colors, camera, unsorted, depths)

    order = workspace.array("order", (n_padded,), np.uint32)
    scratch = [workspace.array(name, (n_padded,), np.uint32) for name in ("key_a", "key_b", "order_b")]
    n_kept = sort.sort_by_depth(depths, n_rows, scratch[0], scratch[1], order, scratch[2])
    records = workspace.array("records", (n_padded, RECORD_FLOATS), np.float32)
    sort.permute_records(unsorted, order, n_kept, is_frozen, records)

    counts = workspace.array("counts", (n_threads, n_tiles), np.int64)
    pairs_of_record = workspace.array("pairs_of_record", (n_padded,), np.int32)
    tile_starts = workspace.array("tile_starts", (n_tiles + 1,), np.int64)
    record_starts = workspace.array("record_starts", (n_padded,), np.int64)
    trained = workspace.array("trained", (n_padded,), np.int32)
    packed = records.view(np.int32)
    binning.count_pairs(records, packed, n_kept, n_columns, counts, pairs_of_record)
    n_pairs, n_trained, n_trained_pairs = binning.place_pairs(
        records, counts, pairs_of_record, n_kept, tile_starts, trained, record_starts
    )
    if n_pairs > _MAX_PAIRS:
        raise MemoryError(f"{n_kept} Gaussians cover {n_pairs} tiles of {TILE} px; at most {_MAX_PAIRS} are possible")
    pair_records = workspace.array("pair_records", (n_pairs,), np.int32)
    pairs_by_record = workspace.array("pairs_by_record", (n_trained_pairs,), np.int32)
    binning.fill_pairs(records, packed, n_kept, n_columns, counts, record_starts, pair_records, pairs_by_record)

    pair_blocks = workspace.array("pair_blocks", (n_pairs,), np.int64)
    image = torch.empty(view.height, view.width, 3)
    transmittance = torch.empty(view.height, view.width)
    blend.blend_tiles(
        records,
        tile_starts,
        pair_records,
        n_columns,
        background.detach().numpy(),
        image.numpy(),
        transmittance.numpy(),
        pair_blocks,
        workspace.array("scratch", (n_threads, SCRATCH_FLOATS), np.float32),
        np.zeros(1, np.int64),
    )
    drawing = _Drawing(
        workspace,
        camera,
        n_kept,
        n_pairs,
        n_trained,
        n_columns,
        order,
        records,
        tile_starts,
        trained,
        pairs_of_record,
        record_starts,
        pair_records,
        pairs_by_record,
        pair_blocks,
    )
    return image, transmittance, drawing


def _write_centers(drawing: _Drawing, centers: Tensor) -> None:
    rows = drawing.order[: drawing.n_kept]
    centers.detach().numpy()[rows] = drawing.records[: drawing.n_kept, :2]


def _differentiate(
    drawing: _Drawing,
    parameters: list[Tensor],
    image: Tensor,
    transmittance: Tensor,
    grad_image: Tensor,
    grad_transmittance: Tensor,
) -> tuple[list[Tensor], Tensor]:
    """Gradients of the five parameters, and of the centres in pixels."""
    grads = [torch.zeros_like(tensor) for tensor in parameters]
    grad_centers = torch.zeros(len(parameters[0]), 2)
    if not drawing.n_trained:
        return grads, grad_centers
    workspace = drawing.workspace
    n_threads = get_num_threads()
    scratch = workspace.array("scratch", (n_threads, SCRATCH_FLOATS), np.float32)
    pair_sums = workspace.array(_EARLY_AND_LATE, (drawing.n_pairs, PAIR_FLOATS), np.float32)
    blend_backward.replay_tiles(
        drawing.records,
        drawing.tile_starts,
        drawing.pair_records,
        drawing.n_columns,
        image.numpy(),
        transmittance.numpy(),
        grad_image.numpy(),
        grad_transmittance.contiguous().numpy(),
        drawing.pair_blocks,
        pair_sums,
        scratch,
        np.zeros(1, np.int64),
    )
    means, quats, scales, *_ = (tensor.detach().numpy() for tensor in parameters)
    grad_means, grad_quats, grad_scales, grad_opacities, grad_colors = (grad.numpy() for grad in grads)
    project_backward.project_backward(
        drawing.records,
        drawing.order,
        drawing.trained,
        drawing.n_trained,
        drawing.pairs_of_record,
        drawing.record_starts,
        drawing.pairs_by_record,
        pair_sums,
        means,
        quats,
        scales,
        drawing.camera,
        scratch,
        workspace.array("lane_rows", (n_threads, 2, 16), np.int32),
        grad_means,
        grad_quats,
        grad_scales,
        grad_opacities,
        grad_colors,
        grad_centers.numpy(),
    )
    return grads, grad_centers
