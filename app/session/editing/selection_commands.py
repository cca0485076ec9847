"""Commands that select, as frozen dataclasses in the imperative. See app.session.commands.

They act on the frame that is shown. The selection is not part of the document: undo does not touch it, `Reselect`
brings the selection before back.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from engine.editing.actions import Vector
from engine.editing.edit import Volume
from engine.editing.selection.seen_from import SeenFrom
from engine.editing.selection.set_algebra import SelectMode


@dataclass(frozen=True, slots=True)
class Rectangle:
    """Between two corners, px of the picture."""

    x0: float
    y0: float
    x1: float
    y1: float


@dataclass(frozen=True, slots=True)
class Lasso:
    """A line that is closed from its end to its beginning, px of the picture."""

    points: tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True)
class Brush:
    """A disc that is moved along a line, px of the picture."""

    points: tuple[tuple[float, float], ...]
    radius: float


Shape = Rectangle | Lasso | Brush


@dataclass(frozen=True, slots=True)
class How:
    """How the selection before and anchors that are found in part are treated.

    Attributes:
        mode: See engine.editing.selection.set_algebra.
        is_whole_anchors: Whether all Gaussians of an anchor are meant with one of them.
    """

    mode: SelectMode = "replace"
    is_whole_anchors: bool = False


@dataclass(frozen=True, slots=True)
class SelectInPicture:
    """Select Gaussians under a shape in the picture of a view."""

    shape: Shape
    view: SeenFrom
    how: How = field(default_factory=How)
    is_visible_only: bool = False
    """Only Gaussians that are not hidden."""
    is_by_extent: bool = False
    """As far as a Gaussian is seen, and not by its centre alone."""


@dataclass(frozen=True, slots=True)
class SelectVolume:
    """Select Gaussians in a box, a sphere or a prism."""

    volume: Volume
    how: How = field(default_factory=How)
    is_by_extent: bool = False


@dataclass(frozen=True, slots=True)
class SelectFlood:
    """Select the Gaussian nearest to a place, and all that are connected with it over neighbours of like colour."""

    place: Vector
    distance: float
    """Between neighbours, scene units."""
    color_tolerance: float
    """Of each channel, 0..1."""
    how: How = field(default_factory=How)


@dataclass(frozen=True, slots=True)
class SelectByAttribute:
    """Select Gaussians whose attribute lies in a range, both ends included."""

    attribute: str
    """See app.session.editing.attributes."""
    low: float
    high: float
    how: How = field(default_factory=How)


@dataclass(frozen=True, slots=True)
class SelectAnchor:
    """Select all Gaussians of the anchor nearest to a place, such as that of the mark that was clicked."""

    place: Vector
    how: How = field(default_factory=How)


@dataclass(frozen=True, slots=True)
class GrowSelection:
    """Also select Gaussians within a distance of selected ones. Scene units"""

    distance: float


@dataclass(frozen=True, slots=True)
class ShrinkSelection:
    """Leave out Gaussians within a distance of others that are not selected. Scene units"""

    distance: float


@dataclass(frozen=True, slots=True)
class InvertSelection:
    """Select shown Gaussians that are not selected, and nothing else."""


@dataclass(frozen=True, slots=True)
class SelectAll:
    """Select everything that is shown."""


@dataclass(frozen=True, slots=True)
class ClearSelection:
    """Select nothing."""


@dataclass(frozen=True, slots=True)
class Reselect:
    """Bring back the previous selection; again brings back the present one."""


SelectionCommand = (
    SelectInPicture
    | SelectVolume
    | SelectFlood
    | SelectByAttribute
    | SelectAnchor
    | GrowSelection
    | ShrinkSelection
    | InvertSelection
    | SelectAll
    | ClearSelection
    | Reselect
)
"""Commands on the selection."""
