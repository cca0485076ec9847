"""Attributes: numbers that every Gaussian of a frame has, to select by."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from app.playback.modes.arrays import GaussianArrays
from app.playback.modes.contents import BORN_HERE, LEARNED_ON, OF_REFERENCE
from engine.clip_files.roles import STATIC
from engine.editing.fills.fill import FILLED, GUESSED


@dataclass(frozen=True, slots=True)
class Attribute:
    """One number.

    Attributes:
        name: In commands.
        label: As shown to the user.
        unit: Of the number; empty for a plain one.
        is_log: Whether its values run over decades.
        choices: Where it has a few values only, their words; else empty.
        column: Of app.residuals.anchor_heat, where the residual of its anchor is meant; else empty.
    """

    name: str
    label: str
    unit: str = ""
    is_log: bool = False
    choices: tuple[tuple[float, str], ...] = ()
    column: str = ""


STANDS_STILL, MOVES = 0, 1
ATTRIBUTES = MappingProxyType(
    {
        attribute.name: attribute
        for attribute in (
            Attribute("opacity", "Opacity"),
            Attribute("size", "Size", "scene units", is_log=True),
            Attribute("error", "Error against the cameras", "/255", column="error"),
            Attribute("flicker", "Excess flicker", "/255", column="E"),
            Attribute("clip", "Clip of birth"),
            Attribute(
                "birth",
                "Birth",
                choices=(
                    (OF_REFERENCE, "from the reference clip"),
                    (LEARNED_ON, "from the reference, trained further"),
                    (BORN_HERE, "born in this clip"),
                ),
            ),
            Attribute("motion", "Static or moving", choices=((STANDS_STILL, "static"), (MOVES, "moving"))),
        )
    }
)
"""By name."""


@dataclass(frozen=True, slots=True, eq=False)
class AnchorValues:
    """Residuals of the anchors of a frame, see app.residuals.anchor_heat.AnchorHeat.

    Attributes:
        positions: [A, 3]
        values: NaN where unknown. [A]
    """

    positions: np.ndarray
    values: np.ndarray


def values_of(name: str, gaussians: GaussianArrays, anchors: AnchorValues | None = None) -> np.ndarray:
    """An attribute of every Gaussian; NaN where it is unknown. [N] float32

    Args:
        anchors: Of the same frame, where a residual is asked for; None while those are not known.

    Raises:
        ValueError: There is no such attribute.
    """
    n, rows = len(gaussians), gaussians.rows
    match name:
        case "opacity":
            return gaussians.opacities
        case "size":
            return gaussians.scales.max(axis=1, initial=0.0)
        case "birth" if gaussians.births is not None:
            return gaussians.births.astype(np.float32)
        case "clip" if rows is not None:
            return np.array([row_set.clip_index for row_set in rows.sets], np.float32)[rows.set_index]
        case "motion" if rows is not None:
            moves = [STANDS_STILL if row_set.role in (STATIC, FILLED, GUESSED) else MOVES for row_set in rows.sets]
            return np.array(moves, np.float32)[rows.set_index]
        case "error" | "flicker" if anchors is not None and len(anchors.values):
            return _of_anchors(gaussians, anchors)
        case _ if name in ATTRIBUTES:
            return np.full(n, np.nan, np.float32)
        case _:
            raise ValueError(f"attributes are {', '.join(ATTRIBUTES)}, not {name!r}")


def _of_anchors(gaussians: GaussianArrays, anchors: AnchorValues) -> np.ndarray:
    """The value of each Gaussian's anchor. Anchors are in the order of their Gaussians; where some were left out, the
    nearest one counts."""
    n_each, n_left = divmod(len(gaussians), len(anchors.values))
    if n_left == 0:
        return np.repeat(anchors.values, n_each)
    from scipy.spatial import KDTree

    is_sound = np.isfinite(gaussians.means).all(axis=1)
    values = np.full(len(gaussians), np.nan, np.float32)
    values[is_sound] = anchors.values[KDTree(anchors.positions).query(gaussians.means[is_sound])[1]]
    return values
