"""Scenes for the file formats: drawn by chance, and at the edges of what formats can hold."""

from __future__ import annotations

import io

import numpy as np

from engine.export.formats.table import Format
from engine.export.splats import Splats


def chance_splats(n: int, *, seed: int = 0, extent: float = 2.0) -> Splats:
    """Gaussians in a cube of a room's size, of sizes from a millimetre to a hand, if units are metres."""
    random = np.random.default_rng(seed)
    return Splats.from_arrays(
        random.uniform(-extent, extent, (n, 3)),
        random.standard_normal((n, 4)),
        np.exp(random.uniform(np.log(1e-3), np.log(0.1), (n, 3))),
        random.uniform(0.02, 0.98, n),
        random.uniform(0.0, 1.0, (n, 3)),
    )


def one_splat(**values: object) -> Splats:
    """One Gaussian, of which some values are others."""
    known = {
        "means": [[0.5, -1.25, 3.0]],
        "quats": [[1.0, 0.0, 0.0, 0.0]],
        "scales": [[0.01, 0.02, 0.04]],
        "opacities": [0.5],
        "colors": [[0.2, 0.5, 0.8]],
    }
    return Splats.from_arrays(*(np.array(values.get(name, usual)) for name, usual in known.items()))


def round_trip(kind: Format, splats: Splats) -> Splats:
    """Written and read."""
    file = io.BytesIO()
    kind.write(splats, file)
    file.seek(0)
    return kind.read(file)


def order_of(found: Splats, splats: Splats) -> np.ndarray:
    """The row of `splats` that each row of `found` was: some formats change the order. Nearest centre and size."""
    from scipy.spatial import KDTree

    keys = [
        np.concatenate([s.means.astype(float), 0.1 * np.log(s.scales.astype(float))], axis=1) for s in (splats, found)
    ]
    return np.asarray(KDTree(keys[0]).query(keys[1])[1])


def angles_deg(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angles between rotations, degrees. [N]"""
    products = np.abs((a.astype(float) * b.astype(float)).sum(1))
    return np.degrees(2.0 * np.arccos(np.minimum(products, 1.0)))
