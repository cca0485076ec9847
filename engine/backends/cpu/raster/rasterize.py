"""The fast back end: kernels in order, and their place in autograd.

records (project) -> depth order (sort) -> tile lists (binning) -> pixels (blend); backward: replay of the tiles
(blend_backward) -> gradients (project_backward). Sources of the method: 3D Gaussian Splatting (Kerbl et al. 2023) for
the image formation; the rest is explained where it is done.

Images and gradients are made by the kernels alone: a torch operation between two of them would wake torch's own
threads, which then spin on the cores that the next kernel needs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numba import get_num_threads
from torch import Tensor

from engine.backends.cpu.raster import binning, blend, blend_backward, project, project_backward, sort
from engine.backends.cpu.raster.camera_row import camera_row
from engine.backends.cpu.raster.record import BLUE, GREEN, PAIR_FLOATS, RECORD_FLOATS, RED, TILE
from engine.backends.cpu.raster.tile import SCRATCH_FLOATS
from engine.kernels.launch import launch, parallel_guard
from engine.kernels.workspace import Workspace, WorkspacePool
from engine.raster.gaussians import Gaussians
from engine.raster.pinhole_view import PinholeView
from engine.raster.rendering import Rendering

POOL = WorkspacePool()
"""Idle buffers of this process."""

_MAX_PAIRS = 2**31 - 1
_EARLY_AND_LATE = "unsorted, then pair_sums"
"""Unsorted records are done with before the backward pass begins; its largest buffer takes their place."""
_NO_FLAGS = np.zeros(0, np.bool_)
_NO_MASK_SUMS = np.zeros((0, 0), np.int32)
_NO_INDICES = np.zeros(0, np.int32)
_NO_CENTERS = np.zeros((0, 2), np.float32)
_NO_PIXELS = np.zeros((0, 0), np.float32)


@dataclass(slots=True)
class _Drawing:
    """One view's tile lists and everything its backward pass needs. Arrays live in `workspace`."""

    workspace: Workspace
    view: PinholeView
    camera: np.ndarray
    order: np.ndarray
    records: np.ndarray
    tile_starts: np.ndarray
    pair_records: np.ndarray
    pair_slots: np.ndarray
    pair_blocks: np.ndarray
    trained: np.ndarray
    pairs_of_row: np.ndarray
    row_slots: np.ndarray
    n_trained: int
    n_slots: int

    @property
    def n_columns(self) -> int:
        return -(-self.view.width // TILE)


@dataclass(frozen=True, slots=True)
class _Request:
    """The inputs that no gradient flows to."""

    view: PinholeView
    is_frozen: np.ndarray
    tile_mask: np.ndarray
    """[rows, columns] bool, or empty for all tiles."""


def rasterize_cpu(
    gaussians: Gaussians,
    views: list[PinholeView],
    background: Tensor,
    *,
    tile_mask: Tensor | None,
    want_means2d: bool,
    want_depth: bool,
) -> Rendering:
    """Render every view. Arguments are those of `rasterize`, already checked; float32 on the cpu."""
    parameters = [tensor.contiguous() for tensor in gaussians.tensors()]
    is_frozen = _NO_FLAGS if gaussians.is_frozen is None else gaussians.is_frozen.contiguous().numpy()
    background = background.contiguous()
    means2d = torch.empty(len(views), len(gaussians), 2) if want_means2d else None
    is_recorded = torch.is_grad_enabled() and (
        want_means2d or background.requires_grad or any(tensor.requires_grad for tensor in parameters)
    )
    if means2d is not None:
        means2d.requires_grad_(is_recorded)
    centers_of = [None] * len(views) if means2d is None else means2d.unbind()
    images, alphas, depths = [], [], []
    for index, view in enumerate(views):
        mask = _NO_FLAGS if tile_mask is None else tile_mask[index].contiguous().numpy()
        request = _Request(view, is_frozen, mask)
        centers = centers_of[index]
        if is_recorded:
            drawing = _DrawingSlot()
            image, alpha = _Rasterize.apply(request, drawing, centers, background, *parameters)  # pyright: ignore
            if want_depth:
                depth_colors = _depth_colors(parameters[0], view)
                black = torch.zeros(3)
                depth, _ = _Rasterize.apply(request, drawing, None, black, *parameters[:4], depth_colors)  # pyright: ignore
                depths.append(depth[..., :1])
        else:
            with parallel_guard():
                drawing = _draw(request, parameters, None if centers is None else centers.numpy(), has_backward=False)
                image, _, alpha = _blend(drawing, background)
                if want_depth:
                    depth, *_ = _blend(_recolored(drawing, _depth_colors(parameters[0], view)), torch.zeros(3))
                    depths.append(depth[..., :1])
            POOL.give_back(drawing.workspace)
        images.append(image)
        alphas.append(alpha)
    return Rendering(_stack(images), _stack(alphas), means2d, _stack(depths) if want_depth else None)


def _stack(pictures: list[Tensor]) -> Tensor:
    return pictures[0][None] if len(pictures) == 1 else torch.stack(pictures)


def _depth_colors(means: Tensor, view: PinholeView) -> Tensor:
    """Camera depth as the first of three colours, differentiable. [N, 3]"""
    axis = torch.from_numpy(view.rotation[2]).to(means)
    depths = means @ axis + float(view.translation[2])
    return torch.stack([depths, torch.zeros_like(depths), torch.zeros_like(depths)], -1)


class _DrawingSlot:
    """Hands the tile lists of a view from its first blend to a second one with other colours."""

    drawing: _Drawing | None = None
    lease: Tensor | None = None


class _Rasterize(torch.autograd.Function):
    """One view. Gradients for the centres, the background and the five parameters."""

    @staticmethod
    def forward(
        ctx: Any,
        request: _Request,
        slot: _DrawingSlot,
        centers: Tensor | None,
        background: Tensor,
        *parameters: Tensor,
    ):
        ctx.set_materialize_grads(False)
        with parallel_guard():
            if slot.drawing is None or slot.lease is None:
                slot.drawing = _draw(request, parameters, None if centers is None else centers.numpy(), True)
                slot.lease = POOL.lease(slot.drawing.workspace)
                drawing = slot.drawing
            else:
                drawing = _recolored(slot.drawing, parameters[-1])
            image, transmittance, alpha = _blend(drawing, background)
        ctx.drawing = drawing
        ctx.tile_mask = request.tile_mask
        ctx.save_for_backward(slot.lease, image, transmittance, *parameters)
        return image, alpha

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, grad_image: Tensor | None, grad_alpha: Tensor | None):  # pyright: ignore[reportIncompatibleMethodOverride]
        _lease, image, transmittance, *parameters = ctx.saved_tensors
        _, _, needs_centers, needs_background, *needs_parameters = ctx.needs_input_grad
        grad_background = None
        if needs_background:
            grad_background = _background_gradient(grad_image, transmittance, ctx.tile_mask)
        if not needs_centers and not any(needs_parameters):
            return None, None, None, grad_background, *[None] * len(parameters)
        with parallel_guard():
            grads, grad_centers = _differentiate(ctx.drawing, parameters, image, transmittance, grad_image, grad_alpha)
        return None, None, grad_centers if needs_centers else None, grad_background, *grads


def _background_gradient(grad_image: Tensor | None, transmittance: Tensor, tile_mask: np.ndarray) -> Tensor:
    if grad_image is None:
        return torch.zeros(3)
    if tile_mask.size:
        height, width = transmittance.shape
        pixels = torch.from_numpy(tile_mask.repeat(TILE, 0).repeat(TILE, 1)[:height, :width])
        transmittance = torch.where(pixels, transmittance, 0.0)
        grad_image = torch.where(pixels[..., None], grad_image, 0.0)
    return (grad_image * transmittance[..., None]).sum(dim=(0, 1))


def _draw(request: _Request, parameters: Sequence[Tensor], centers: np.ndarray | None, has_backward: bool) -> _Drawing:
    """Project, sort and bin: everything that does not depend on colours."""
    workspace = POOL.take()
    view, tile_mask = request.view, request.tile_mask
    n_rows = len(parameters[0])
    n_threads = get_num_threads()
    camera = camera_row(view)
    n_columns, n_tile_rows = -(-view.width // TILE), -(-view.height // TILE)
    n_tiles = n_columns * n_tile_rows

    n_padded = -(-max(n_rows, 1) // 16) * 16
    unsorted = workspace.array(_EARLY_AND_LATE, (n_padded, RECORD_FLOATS), np.float32)
    depths = workspace.array("depths", (n_padded,), np.float32)
    mask_sums = binning.mask_sums(tile_mask) if tile_mask.size else _NO_MASK_SUMS
    if n_rows:
        means, quats, scales, opacities, colors = parameters
        job = project.ProjectJob(
            means,
            quats,
            scales,
            opacities,
            colors,
            camera,
            mask_sums,
            unsorted,
            unsorted.view(np.int32),
            depths,
            _NO_CENTERS if centers is None else centers,
        )
        launch(project.project, job, n_threads)

    order = workspace.array("order", (n_padded,), np.uint32)
    scratch = [workspace.array(name, (n_padded,), np.uint32) for name in ("key_a", "key_b", "order_b")]
    n_kept = sort.sort_by_depth(depths, n_rows, scratch[0], scratch[1], order, scratch[2])

    records = workspace.array("records", (n_kept, RECORD_FLOATS), np.float32)
    packed = records.view(np.int32)
    counts = workspace.array("counts", (n_threads, n_tiles), np.int64)
    pairs_of_row = workspace.array("pairs_of_row", (n_rows,), np.int32)
    pairs_of_row.fill(0)
    tile_starts = workspace.array("tile_starts", (n_tiles + 1,), np.int64)
    flat_mask = tile_mask.reshape(-1)
    job = binning.CountJob(unsorted, order, n_kept, n_columns, flat_mask, records, packed, counts, pairs_of_row)
    launch(binning.gather_and_count, job, n_threads)
    n_pairs = binning.place_pairs(counts, tile_starts)
    if n_pairs > _MAX_PAIRS:
        raise MemoryError(f"{n_kept} Gaussians cover {n_pairs} tiles of {TILE} px; at most {_MAX_PAIRS} are possible")
    trained = row_slots = pair_slots = _NO_INDICES
    n_trained = n_slots = 0
    if has_backward:
        trained = workspace.array("trained", (n_rows,), np.int32)
        row_slots = workspace.array("row_slots", (n_rows,), np.int32)
        n_trained, n_slots = binning.place_slots(pairs_of_row, request.is_frozen, trained, row_slots)
        pair_slots = workspace.array("pair_slots", (n_pairs,), np.int32)
    pair_records = workspace.array("pair_records", (n_pairs,), np.int32)
    job = binning.FillJob(
        records, packed, order, n_kept, n_columns, flat_mask, counts, row_slots, pair_records, pair_slots
    )
    launch(binning.fill_pairs, job, n_threads)
    return _Drawing(
        workspace=workspace,
        view=view,
        camera=camera,
        order=order[:n_kept],
        records=records,
        tile_starts=tile_starts,
        pair_records=pair_records,
        pair_slots=pair_slots,
        pair_blocks=workspace.array("pair_blocks", (n_pairs,), np.int64),
        trained=trained,
        pairs_of_row=pairs_of_row,
        row_slots=row_slots,
        n_trained=n_trained,
        n_slots=n_slots,
    )


def _recolored(drawing: _Drawing, colors: Tensor) -> _Drawing:
    """The same drawing with other colours [N, 3]; at most one such copy of a drawing may be alive."""
    records = drawing.workspace.array("recolored", drawing.records.shape, np.float32)
    records[:] = drawing.records
    chosen = colors.detach().numpy()[drawing.order]
    for column, field in enumerate((RED, GREEN, BLUE)):
        records[:, field] = chosen[:, column]
    return replace(drawing, records=records)


def _blend(drawing: _Drawing, background: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Image [H, W, 3], transmittance [H, W] and alpha [H, W, 1]; fills pair_blocks."""
    view = drawing.view
    image = torch.empty(view.height, view.width, 3)
    transmittance = torch.empty(view.height, view.width)
    alpha = torch.empty(view.height, view.width, 1)
    n_threads = get_num_threads()
    job = blend.BlendJob(
        drawing.records,
        drawing.tile_starts,
        drawing.pair_records,
        drawing.n_columns,
        background,
        image,
        transmittance,
        alpha[..., 0],
        drawing.pair_blocks,
        drawing.workspace.array("scratch", (n_threads, SCRATCH_FLOATS), np.float32),
    )
    launch(blend.blend_tiles, job, n_threads)
    return image, transmittance, alpha


def _differentiate(
    drawing: _Drawing,
    parameters: list[Tensor],
    image: Tensor,
    transmittance: Tensor,
    grad_image: Tensor | None,
    grad_alpha: Tensor | None,
) -> tuple[list[Tensor], Tensor]:
    """Gradients of the five parameters, and of the centres in pixels."""
    if not drawing.n_trained:
        return [torch.zeros_like(tensor) for tensor in parameters], torch.zeros(len(parameters[0]), 2)
    if grad_image is None:
        grad_image = torch.zeros_like(image)
    workspace = drawing.workspace
    n_threads = get_num_threads()
    scratch = workspace.array("scratch", (n_threads, SCRATCH_FLOATS), np.float32)
    # one row more than is used: a row of twelve floats is read as sixteen
    pair_sums = workspace.array(_EARLY_AND_LATE, (drawing.n_slots + 1, PAIR_FLOATS), np.float32)
    job = blend_backward.ReplayJob(
        drawing.records,
        drawing.tile_starts,
        drawing.pair_records,
        drawing.pair_slots,
        drawing.n_columns,
        image,
        transmittance,
        grad_image.contiguous(),
        _NO_PIXELS if grad_alpha is None else grad_alpha[..., 0].contiguous(),
        drawing.pair_blocks,
        pair_sums,
        scratch,
    )
    launch(blend_backward.replay_tiles, job, n_threads)
    means, quats, scales, opacities, _ = parameters
    grads = [torch.empty_like(tensor) for tensor in parameters]
    grad_means, grad_quats, grad_scales, grad_opacities, grad_colors = grads
    grad_centers = torch.empty(len(means), 2)
    job = project_backward.BackwardJob(
        drawing.trained,
        drawing.n_trained,
        drawing.pairs_of_row,
        drawing.row_slots,
        pair_sums,
        means,
        quats,
        scales,
        opacities,
        drawing.camera,
        scratch,
        grad_means,
        grad_quats,
        grad_scales,
        grad_opacities,
        grad_colors,
        grad_centers,
    )
    launch(project_backward.project_backward, job, n_threads)
    return grads, grad_centers
