"""The Gaussians of a frame that a command finds. Pure; runs on a thread, which imports the compiled kernels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from app.playback.modes.arrays import GaussianArrays
from app.session.editing.attributes import AnchorValues, values_of
from app.session.editing.selection import Selection, whole_anchors
from app.session.editing.selection_commands import (
    Brush,
    ClearSelection,
    GrowSelection,
    How,
    InvertSelection,
    Lasso,
    Rectangle,
    Reselect,
    SelectAll,
    SelectAnchor,
    SelectByAttribute,
    SelectFlood,
    SelectInPicture,
    SelectionCommand,
    SelectVolume,
    Shape,
    ShrinkSelection,
)
from engine.editing.selection.ranges import in_range
from engine.editing.selection.set_algebra import combined


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """The frame that a command acts on.

    Attributes:
        gaussians: Of the frame, with their rows.
        selected: Which of them are selected already. [N] bool
        anchors: Residuals of its anchors; None where unknown.
        gaussians_per_anchor: K.
    """

    gaussians: GaussianArrays
    selected: np.ndarray
    anchors: AnchorValues | None = None
    gaussians_per_anchor: int = 1


def found_by(command: SelectionCommand, ground: Ground) -> np.ndarray:
    """Gaussians of the frame that a command means; of one that changes the selection itself, those that are selected
    afterwards. [N] bool

    Raises:
        ValueError: The command is not valid: an attribute that does not exist.
        TypeError: The command finds nothing.
    """
    from engine.editing.selection.neighbours import flooded, grown, shrunk
    from engine.editing.selection.volumes import in_volume

    gaussians, selected = ground.gaussians, ground.selected
    means = gaussians.means
    match command:
        case SelectInPicture():
            return _in_picture(command, gaussians)
        case SelectVolume(volume=volume, is_by_extent=is_by_extent):
            spread = {"quats": gaussians.quats, "scales": gaussians.scales} if is_by_extent else {}
            return in_volume(volume, means, **spread)
        case SelectFlood():
            row = _nearest(means, command.place)
            if row is None:
                return np.zeros(len(means), np.bool_)
            return flooded(means, gaussians.colors, row, command.distance, command.color_tolerance)
        case SelectByAttribute(attribute=attribute, low=low, high=high):
            return in_range(values_of(attribute, gaussians, ground.anchors), low, high)
        case SelectAnchor(place=place):
            return _of_anchor(ground, place)
        case GrowSelection(distance=distance):
            return grown(means, selected, distance)
        case ShrinkSelection(distance=distance):
            return shrunk(means, selected, distance)
        case InvertSelection():
            return ~selected
        case SelectAll():
            return np.ones(len(means), np.bool_)
        case _:
            raise TypeError(f"{type(command).__name__} finds nothing")


def selection_after(selection: Selection, command: SelectionCommand, ground: Ground, found: np.ndarray) -> Selection:
    """The selection once a command has found something.

    Args:
        selection: Before the command.
        ground: That the command acted on, with rows.
        found: See `found_by`. [N] bool
    """
    rows = ground.gaussians.rows
    assert rows is not None  # nothing can be selected without
    how, keeps_others = _how(command)
    if how.is_whole_anchors:
        found = whole_anchors(rows, found, ground.gaussians_per_anchor)
    return selection.with_mask(rows, combined(ground.selected, found, how.mode), keeps_others=keeps_others)


def _how(command: SelectionCommand) -> tuple[How, bool]:
    """How the selection changes, and whether Gaussians that do not exist in the frame stay in it."""
    match command:
        case GrowSelection() | ShrinkSelection():
            return How(), True
        case InvertSelection() | SelectAll() | ClearSelection() | Reselect():
            return How(), False
        case _:
            return command.how, command.how.mode in ("add", "subtract")


def shape_mask(shape: Shape, size: tuple[int, int]) -> np.ndarray:
    """Pixels of a shape. [H, W] bool"""
    from engine.editing.selection.shapes import brush_mask, lasso_mask, rectangle_mask

    match shape:
        case Rectangle(x0=x0, y0=y0, x1=x1, y1=y1):
            return rectangle_mask(x0, y0, x1, y1, size)
        case Lasso(points=points):
            return lasso_mask(np.array(points), size)
        case Brush(points=points, radius=radius):
            return brush_mask(np.array(points), radius, size)


def _in_picture(command: SelectInPicture, gaussians: GaussianArrays) -> np.ndarray:
    from engine.editing.selection.in_picture import under_mask
    from engine.editing.selection.projected import project_gaussians
    from engine.editing.selection.visibility import seen_rows

    view = replace(command.view, near=max(command.view.near, gaussians.near_plane))
    projected = project_gaussians(gaussians.means, gaussians.quats, gaussians.scales, view)
    found = under_mask(projected, shape_mask(command.shape, view.size), is_by_extent=command.is_by_extent)
    if command.is_visible_only and found.any():
        found &= seen_rows(projected, gaussians.opacities)
    return found


def _nearest(points: np.ndarray, place: tuple[float, float, float]) -> int | None:
    """Row of the point nearest to a place; None where none is finite."""
    with np.errstate(invalid="ignore"):
        away = ((points - np.asarray(place, np.float32)) ** 2).sum(axis=1)
    away[~np.isfinite(away)] = np.inf
    return int(away.argmin()) if len(away) and np.isfinite(away.min()) else None


def _of_anchor(ground: Ground, place: tuple[float, float, float]) -> np.ndarray:
    """Gaussians of the anchor nearest to a place. Without a list of anchors, of the one whose Gaussian is nearest."""
    gaussians, k = ground.gaussians, ground.gaussians_per_anchor
    found, rows = np.zeros(len(gaussians), np.bool_), gaussians.rows
    anchors = None if ground.anchors is None else ground.anchors.positions
    is_complete = anchors is not None and len(anchors) * k == len(gaussians)
    nearest = _nearest(anchors if is_complete and anchors is not None else gaussians.means, place)
    if nearest is None:
        return found
    row = nearest * k if is_complete else nearest
    if rows is None:
        found[row] = True
        return found
    return (rows.set_index == rows.set_index[row]) & (rows.number // k == rows.number[row] // k)
