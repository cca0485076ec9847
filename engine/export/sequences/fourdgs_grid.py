"""The grids of a .4dgs file: how numbers become whole numbers, and rows of Gaussians a chunk of the file."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from fourdgs import opcode, records
from fourdgs.quantization import (
    Bounds,
    Steps,
    life_class,
    motion_steps,
    quantize,
    quantize_rotation,
    rct_forward,
)
from fourdgs.serialization import CODEC_DEFLATE, encode_stream

from engine.export.splats import THINNEST, Splats

POSITION_SHARE = 0.05
"""Positions are off by this share of the largest side of a usual Gaussian at most."""
BOUNDS = {"scale_rel": 0.03, "rot": 0.006, "rgb": 1.0 / 255.0, "alpha": 2.0 / 255.0, "sigma_rel": 0.05, "sh": 0}
"""Of everything else, as the file states them."""
COARSE = {opcode.A_SCALE: 2, opcode.A_ROTATION: 3, opcode.A_COLOR: 3, opcode.A_OPACITY: 2}
"""Steps of the grids that count as one in what moves, which is seen less well."""
LARGEST_BIN = 1 << 30
"""Positions that are farther off than this cannot be stored."""
DEFLATE_LEVEL = 9


@dataclass(frozen=True, slots=True)
class ChunkRows:
    """Rows of one chunk.

    Attributes:
        splats: N of them, means at the first frame of each.
        first, end: Frames of the file. [N] int64
        velocities: Units per frame; None where nothing moves. [N, 3]
    """

    splats: Splats
    first: np.ndarray
    end: np.ndarray
    velocities: np.ndarray | None = None

    def __getitem__(self, rows: np.ndarray) -> ChunkRows:
        """The chosen rows."""
        velocities = None if self.velocities is None else self.velocities[rows]
        return ChunkRows(self.splats[rows], self.first[rows], self.end[rows], velocities)


class FourdgsGrid:
    """The grids of one file.

    Args:
        parts: Splats that the file begins with, from whose sizes grids follow; one of them has rows.
        fps: Frames per second.
    """

    def __init__(self, parts: list[Splats], fps: float) -> None:
        parts = [part for part in parts if len(part)]
        usual = min(float(np.median(part.scales.max(1))) for part in parts)
        position = max(POSITION_SHARE * usual, THINNEST)
        self.fps = fps
        self.origin = np.median(np.concatenate([part.means for part in parts]), axis=0).astype(np.float64)
        self.bounds = Bounds(pos=position, motion=position, time=0.5 / fps, **BOUNDS)
        self.steps = Steps.of(self.bounds)

    def record(self) -> bytes:
        """The record that declares them."""
        steps = self.steps
        return records.Quantization(
            scheme="uniform-v1",
            pos_origin=self.origin.tolist(),
            step_pos=steps.pos,
            step_scale_log=steps.scale_log,
            step_rot=steps.rot,
            step_rgb=steps.rgb,
            step_alpha=steps.alpha,
            step_motion=steps.motion,
            step_time=steps.time,
            step_sigma_log=steps.sigma_log,
            step_sh=steps.sh,
            bounds=self.bounds.as_strings(),
        ).encode()

    def storable(self, splats: Splats) -> np.ndarray:
        """Which rows can be stored. [N] bool"""
        return np.abs(splats.means - self.origin).max(1) < LARGEST_BIN * self.steps.pos

    def chunk(self, rows: ChunkRows, windows: np.ndarray) -> tuple[bytes, np.ndarray]:
        """A chunk's record, and the places of its rows as it has them.

        Args:
            rows: At least one.
            windows: Each row's place in the table of windows. [N] int64
        """
        steps, splats, n = self.steps, rows.splats, len(rows.first)
        means = quantize(splats.means - self.origin, steps.pos)
        largest, three = quantize_rotation(splats.quats[:, [1, 2, 3, 0]], steps.rot)
        columns = {
            opcode.A_POSITION: means,
            opcode.A_SCALE: quantize(np.log(splats.scales.astype(np.float64)), steps.scale_log),
            opcode.A_ROTATION_INDEX: largest[:, None],
            opcode.A_ROTATION: three,
            opcode.A_COLOR: quantize(np.clip(splats.colors, 0.0, 1.0), steps.rgb),
            opcode.A_OPACITY: quantize(splats.opacities, steps.alpha)[:, None],
            opcode.A_MOTION: np.zeros((n, 3), np.int64),
            opcode.A_MU_T: rows.first[:, None],
            opcode.A_SIGMA_T: np.zeros((n, 1), np.int64),
            opcode.A_FLAGS: np.full((n, 1), opcode.FLAG_NEVER_FADES),
            opcode.A_WINDOW_INDEX: windows[:, None],
        }
        if rows.velocities is not None:
            for name, step in COARSE.items():
                columns[name] = step * np.rint(columns[name] / step).astype(np.int64)
            lengths = (rows.end - rows.first) / self.fps
            never_fades = np.ones(n, bool)
            pitch = motion_steps(life_class(np.zeros(n), steps.sigma_log, never_fades, lengths), steps.motion)
            columns[opcode.A_MOTION] = quantize(rows.velocities * self.fps / pitch[:, None], 1.0)
        columns[opcode.A_COLOR] = rct_forward(columns[opcode.A_COLOR])
        streams = b"".join(
            encode_stream(name, values, channels=values.shape[1], codec=CODEC_DEFLATE, level=DEFLATE_LEVEL)
            for name, values in columns.items()
        )
        begin, end = self.seconds(int(rows.first.min())), self.seconds(int(rows.end.max()))
        return records.encode_chunk(begin, end, 0, n, streams), means * steps.pos + self.origin

    def seconds(self, frame: int) -> float:
        """When a frame of the file begins."""
        return frame / self.fps
