"""The window's drawings, as plain float32 numpy arrays with a key that identifies them."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from app.playback.picture_source import UNKNOWN, PictureSource
from engine.editing.gaussian_rows import GaussianRows

BACKGROUND = (18 / 255, 20 / 255, 24 / 255)
"""Behind everything; the viewport takes its dark grey from here."""


@dataclass(frozen=True, slots=True, eq=False)
class GaussianArrays:
    """Gaussians of one frame, for upload. float32, C-contiguous.

    Attributes:
        means: [N, 3] scene units.
        quats: [N, 4] wxyz, not necessarily of unit length.
        scales: [N, 3] standard deviations, scene units.
        opacities: [N] in 0..1.
        colors: [N, 3] in 0..1.
        key: Changes when the content does.
        near_plane: Nearest depth that should be drawn, scene units.
        source: The frame, and the state of the clip it was decoded from.
        n_still: So many rows come first and differ in nothing but their colours between arrays of one `still_key`.
        still_key: None where no rows are known to be so.
        births: The origin of each, see app.playback.modes.contents; None where unknown. [N] uint8
        changes: How far each is from the reference clip, NaN where that has none; None where nobody asked.
            [N] float32
        rows: Which Gaussian of which anchor set each is, the same in all frames and clips; None where they stand for
            none.
    """

    means: np.ndarray
    quats: np.ndarray
    scales: np.ndarray
    opacities: np.ndarray
    colors: np.ndarray
    key: Hashable
    near_plane: float = 0.01
    source: PictureSource = UNKNOWN
    n_still: int = 0
    still_key: Hashable = None
    births: np.ndarray | None = None
    changes: np.ndarray | None = None
    rows: GaussianRows | None = None

    def __len__(self) -> int:
        return len(self.means)

    @property
    def n_bytes(self) -> int:
        """Memory of the arrays."""
        arrays = [self.means, self.quats, self.scales, self.opacities, self.colors]
        arrays += [] if self.rows is None else [self.rows.set_index, self.rows.number]
        return sum(array.nbytes for array in arrays)


@dataclass(frozen=True, slots=True, eq=False)
class AnchorArrays:
    """Anchor positions of one clip, all or those of one frame, scene units, float32.

    Attributes:
        inherited_positions: From the reference clip; empty in the reference clip itself. [A0, 3]
        own_positions: Trained by this clip: all of the reference clip, the residual ones of a source clip. [A, 3]
        key: Changes when the content does.
        inherited_roles, own_roles: The role of each anchor, in engine.clip_files.roles.ROLES; None where unknown.
            [A0], [A] uint8
        inherited_reasons, own_reasons: Why the gate decided so, codes of engine.gate.reasons. [A0], [A] uint8
        source: The frame they are of; unknown for all anchors of the clip.
        spacing: Distance between neighbours, scene units; 0 where unknown.
        has_changing_static: Whether the static anchors have a dynamic feature, as with gate=off.
    """

    inherited_positions: np.ndarray
    own_positions: np.ndarray
    key: Hashable
    inherited_roles: np.ndarray | None = None
    own_roles: np.ndarray | None = None
    inherited_reasons: np.ndarray | None = None
    own_reasons: np.ndarray | None = None
    source: PictureSource = UNKNOWN
    spacing: float = 0.0
    has_changing_static: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class PointArrays:
    """A coloured cloud: points [P, 3] scene units and colors [P, 3] in 0..1, float32. Unpacks as points, colors, key.

    Attributes:
        kind: Its contents: "static" (still parts of a trained reference clip), "moment" (a first rough cloud
            of one frame) or "pictures" (captured pictures placed in space, because there is no cloud yet).
        spacing: Usual distance between neighbours, scene units; 0 when unknown.
    """

    points: np.ndarray
    colors: np.ndarray
    key: Hashable
    kind: str = "static"
    spacing: float = 0.0

    @property
    def is_hint(self) -> bool:
        """Whether it only hints at the scene: pictures, no cloud."""
        return self.kind == "pictures"

    def __iter__(self) -> Iterator[Any]:
        return iter((self.points, self.colors, self.key))


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """A finished picture.

    Attributes:
        image: [H, W, 3] uint8 RGB.
        key: The identity of its contents; equal keys mean equal pictures.
        is_stale: Whether it is not the requested picture, but the newest there is.
        duration_s: How long it took to make; 0 when unknown.
        source: Its source.
        values: The numbers that its colours stand for, NaN where nothing is; None where they stand for none. [H, W]
            float32
    """

    image: np.ndarray
    key: Hashable
    is_stale: bool = False
    duration_s: float = 0.0
    source: PictureSource = UNKNOWN
    values: np.ndarray | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, px."""
        return self.image.shape[1], self.image.shape[0]
