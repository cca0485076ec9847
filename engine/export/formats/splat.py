"""The .splat of antimatter15: 32 bytes per Gaussian without any head, largest first."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from engine.export.formats.damaged import damaged
from engine.export.packing import as_levels
from engine.export.splats import Splats

_NO_TURN = np.array([1.0, 0.0, 0.0, 0.0], np.float32)
_ROW = np.dtype([("mean", "<f4", 3), ("scale", "<f4", 3), ("rgba", "u1", 4), ("quat", "u1", 4)])


def write(splats: Splats, file: BinaryIO) -> tuple[str, ...]:
    """Centres and scales as they are, colour, opacity and rotation in bytes. The largest and most opaque come first."""
    sizes = np.log(splats.scales.astype(np.float64)).sum(1) + np.log(np.maximum(splats.opacities, 1e-9))
    file.write(packed_rows(splats[np.argsort(-sizes, kind="stable")]).tobytes())
    return ()


def packed_rows(splats: Splats) -> np.ndarray:
    """Rows as they are in a file, in the order of the splats."""
    rows = np.empty(len(splats), _ROW)
    rows["mean"], rows["scale"] = splats.means, splats.scales
    rows["rgba"][:, :3] = as_levels(splats.colors)
    rows["rgba"][:, 3] = as_levels(splats.opacities)
    rows["quat"] = np.clip(np.round(splats.quats * 128.0 + 128.0), 0, 255)
    return rows


def read(file: BinaryIO) -> Splats:
    """Read a file of `write`. Raises ProjectError where it is something else."""
    data = file.read()
    if len(data) % _ROW.itemsize:
        raise damaged("it ends in the middle of a Gaussian")
    rows = np.frombuffer(data, _ROW)
    quats = (rows["quat"].astype(np.float32) - 128.0) / 128.0
    lengths = np.linalg.norm(quats, axis=1, keepdims=True)
    return Splats(
        means=rows["mean"],
        quats=np.where(lengths > 0.0, quats / np.maximum(lengths, 1e-9), _NO_TURN),
        scales=rows["scale"],
        opacities=rows["rgba"][:, 3].astype(np.float32) / 255.0,
        colors=rows["rgba"][:, :3].astype(np.float32) / 255.0,
    )
