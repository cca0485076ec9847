"""Tile boxes of projected Gaussians: the projection of a drawing without the drawing, so that both always agree."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from numba import get_num_threads
from torch import Tensor

from engine.backends.cpu.raster import project
from engine.backends.cpu.raster import record as rec
from engine.backends.cpu.raster.binning import mask_sums
from engine.backends.cpu.raster.camera_row import camera_row
from engine.kernels.jobs import Floats1, Ints1, SmallInts2, Workers, read
from engine.kernels.launch import kernel, launch
from engine.kernels.workspace import WorkspacePool
from engine.raster.gaussians import Gaussians
from engine.raster.pinhole_view import PinholeView, n_tiles
from engine.raster.tile_boxes import TileBoxes

POOL = WorkspacePool()
"""Idle buffers of this process."""
_NOWHERE = 1
"""Packed first | last << 16 with the last before the first."""
_NO_MASK_SUMS = np.zeros((0, 0), np.int32)
_NO_CENTERS = np.zeros((0, 2), np.float32)


class BoxJob(NamedTuple):
    """Arguments of `read_boxes`.

    Attributes:
        packed: Records as int32. [>= N, 16]
        keys: Camera depth, or a number <= 0 for rows that are not drawn. [>= N]
        boxes: Written. [N, 2]
    """

    packed: SmallInts2
    keys: Floats1
    boxes: SmallInts2
    n_workers: Workers = None


class CoverJob(NamedTuple):
    """Arguments of `cover`.

    Attributes:
        boxes: [N, 2]
        tiles: Zeros; 1 is written for tiles under a box. [rows, columns]
    """

    boxes: SmallInts2
    tiles: SmallInts2


class MeetJob(NamedTuple):
    """Arguments of `find_meeting`.

    Attributes:
        boxes: [N, 2]
        mask_sums: Of the wanted tiles, see `binning.mask_sums`.
        rows: The number that stands for each box in the result. [N]
        found: Written: `rows` of boxes over a wanted tile, in order. [N]
        n_found: Written: how many. [1]
    """

    boxes: SmallInts2
    mask_sums: SmallInts2
    rows: Ints1
    found: Ints1
    n_found: Ints1


@kernel(BoxJob)
def read_boxes(worker, arguments):
    """See BoxJob."""
    job = read(BoxJob, arguments)
    packed, keys, boxes, n_rows = job.packed, job.keys, job.boxes, len(job.boxes)
    for row in range(n_rows * worker // job.n_workers, n_rows * (worker + 1) // job.n_workers):
        is_drawn = keys[row] > np.float32(0)
        boxes[row, 0] = packed[row, rec.TILE_COLUMNS] if is_drawn else _NOWHERE
        boxes[row, 1] = packed[row, rec.TILE_ROWS] if is_drawn else _NOWHERE


@kernel(CoverJob)
def cover(_worker, arguments):
    """See CoverJob."""
    job = read(CoverJob, arguments)
    boxes, tiles = job.boxes, job.tiles
    for row in range(len(boxes)):
        columns, rows = boxes[row, 0], boxes[row, 1]
        for tile_row in range(rows & 0xFFFF, (rows >> 16) + 1):
            for tile_column in range(columns & 0xFFFF, (columns >> 16) + 1):
                tiles[tile_row, tile_column] = 1


@kernel(MeetJob)
def find_meeting(_worker, arguments):
    """See MeetJob."""
    job = read(MeetJob, arguments)
    boxes, sums, rows, found = job.boxes, job.mask_sums, job.rows, job.found
    n_found = 0
    for row in range(len(boxes)):
        columns, tile_rows = boxes[row, 0], boxes[row, 1]
        left, right = columns & 0xFFFF, (columns >> 16) + 1
        top, bottom = tile_rows & 0xFFFF, (tile_rows >> 16) + 1
        found[n_found] = rows[row]
        if right > left and sums[bottom, right] - sums[top, right] - sums[bottom, left] + sums[top, left] > 0:
            n_found += 1
    job.n_found[0] = n_found


@dataclass(frozen=True, slots=True)
class CpuTileBoxes(TileBoxes):
    """Tile boxes whose questions are answered by kernels."""

    def mask(self) -> Tensor:
        """See TileBoxes."""
        tiles = np.zeros(self.shape, np.int32)
        launch(cover, CoverJob(self.packed, tiles), 1)
        return torch.from_numpy(tiles.astype(bool))

    def _meeting(self, tile_mask: Tensor, rows: Tensor) -> Tensor:
        found, n_found = np.empty(len(self.packed), np.int64), np.zeros(1, np.int64)
        launch(find_meeting, MeetJob(self.packed, mask_sums(tile_mask.numpy()), rows, found, n_found), 1)
        return torch.from_numpy(found[: n_found[0]])


def tile_boxes_cpu(gaussians: Gaussians, view: PinholeView) -> CpuTileBoxes:
    """Boxes of checked Gaussians, float32 on the cpu."""
    n_rows = len(gaussians)
    boxes = np.empty((n_rows, 2), np.int32)
    found = CpuTileBoxes(torch.from_numpy(boxes), n_tiles(view.width, view.height))
    if not n_rows:
        return found
    workspace, n_threads = POOL.take(), get_num_threads()
    n_padded = -(-n_rows // 16) * 16
    records = workspace.array("records", (n_padded, rec.RECORD_FLOATS), np.float32)
    keys = workspace.array("keys", (n_padded,), np.float32)
    means, quats, scales, opacities, colors = (tensor.detach().contiguous() for tensor in gaussians.tensors())
    packed = records.view(np.int32)
    job = project.ProjectJob(
        means,
        quats,
        scales,
        opacities,
        colors,
        camera_row(view),
        _NO_MASK_SUMS,
        records,
        packed,
        keys,
        _NO_CENTERS,
    )
    launch(project.project, job, n_threads)
    launch(read_boxes, BoxJob(packed, keys, boxes), n_threads)
    POOL.give_back(workspace)
    return found
