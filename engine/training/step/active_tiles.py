"""Active tiles: the part of a picture that a source clip's learning Gaussians touch, and the rest as it always is.

Static anchors under frozen heads never change, so a camera's picture of them alone is the same for the whole clip, or,
where the light on them changes, a mean of two: pictures are linear in their colours.
A tile under no learning Gaussian always shows that picture, and no gradient flows back from it; it need not be drawn,
compared or differentiated, whether or not the truth changed there. Tiles are found anew at every step, from the
boxes by which the rasterizer itself bins the learning Gaussians: none is ever missed, and there is nothing to keep in
step with learning. Parameters learn bit for bit as they do with all tiles.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from engine.backends.backend import Backend
from engine.model.clip_model import ClipModel
from engine.model.clip_view import View, render_gaussians
from engine.model.joining import join_frozen
from engine.raster import TileBoxes, tile_boxes
from engine.raster.gaussians import Gaussians
from engine.training.step.valid_pixels import ValidPixels

MAX_BYTES = 1 << 30
"""Memory for the kept views of cameras; those beyond it are drawn with all tiles. 27 cameras of 640 x 360: 100 MB."""


@dataclass(frozen=True, slots=True)
class ActivePicture:
    """The part of one training picture to draw and compare.

    Attributes:
        gaussians: Those that touch an active tile, and all that learn.
        learning: The ones that learn alone.
        n_all: How many there would be with all tiles.
        tile_mask: Active tiles, or None for all; tiles that the camera sees nothing of are none. [rows, columns] bool
        rest: The picture in the other tiles; None where nothing of them counts. [H, W, 3]
    """

    gaussians: Gaussians
    learning: Gaussians
    n_all: int
    tile_mask: Tensor | None = None
    rest: Tensor | None = None


@dataclass(frozen=True, slots=True)
class _FrozenView:
    """A camera's view of the constant Gaussians.

    Attributes:
        pictures: All of them, scene colours over black: in the light of the clip's start and of its end, one where that
            is the same. [H, W, 3] each
        rows: Those that are drawn, in the constant Gaussians. [n] int64
        boxes: Of these rows.
        n_seen: Gaussians of all anchors that the camera may see.
    """

    pictures: tuple[Tensor, ...]
    rows: Tensor
    boxes: TileBoxes
    n_seen: int

    @property
    def n_bytes(self) -> int:
        return sum(picture.nbytes for picture in self.pictures) + self.rows.nbytes + self.boxes.packed.nbytes


class ActiveTiles:
    """Splits training pictures into active tiles and the rest. Owns the frozen pictures of the cameras, made at need.

    Args:
        model: A clip in which one set is constant; see `applies`.
        backend: The backend it is trained with.
        valid: Which pixels of its cameras count.
        max_bytes: Memory for the kept views.
    """

    def __init__(
        self, model: ClipModel, *, backend: Backend, valid: ValidPixels | None = None, max_bytes: int = MAX_BYTES
    ) -> None:
        self._model, self._backend = model, backend
        self._valid = ValidPixels(None, backend.device) if valid is None else valid
        self._constant = [role for role in model.roles() if model.is_constant(role)]
        self._max_bytes = max_bytes
        self._views: dict[int, _FrozenView] = {}
        self._squares: dict[int, Tensor] = {}
        self.n_bytes = 0
        self._is_full = False

    @staticmethod
    def applies(model: ClipModel) -> bool:
        """Whether the first set of a clip, and no other one, is constant, so that tiles can differ."""
        return [model.is_constant(role) for role in model.roles()] == [True] + [False] * (len(model.roles()) - 1)

    def split(self, view_row: int, view: View, clip_time: float, rows: dict[str, Tensor]) -> ActivePicture:
        """The active part of one picture.

        Args:
            rows: Rows that the camera may see, per role; those of the constant set must be the same at every call.
        """
        frozen_view = self._frozen_view(view_row, view, rows)
        (role,) = self._constant
        if frozen_view is None:
            gaussians = self._model.decode(clip_time, rows)
            is_learning = slice(len(rows[role]) * self._model.decoder.gaussians_per_anchor, None)
            return ActivePicture(gaussians, gaussians[is_learning], len(gaussians), self._valid.tiles_of(view_row))
        nothing = rows[role][:0]
        learning = self._model.decode(clip_time, rows | {role: nothing})
        mask = self._boxes(learning, view).mask()
        seen_tiles = self._valid.tiles_of(view_row)
        if seen_tiles is not None:
            mask = mask & seen_tiles
        chosen = frozen_view.boxes.meeting(mask, frozen_view.rows)
        lit = self._model.lit_gaussians(role, clip_time)
        gaussians = join_frozen(lit, chosen, learning, backend=self._backend)
        rest = self._picture_at(frozen_view, clip_time)
        return ActivePicture(gaussians, learning, frozen_view.n_seen + len(learning), mask, rest)

    def _picture_at(self, frozen_view: _FrozenView, clip_time: float) -> Tensor:
        first, last = frozen_view.pictures[0], frozen_view.pictures[-1]
        return first if first is last else torch.lerp(first, last, self._model.light_weights(clip_time)[1])

    def square_outside(self, picture: ActivePicture, item: int, truth: Tensor, gain: Tensor) -> Tensor | float:
        """Mean square that tiles which are not active add to that of the whole picture. Scalar

        Args:
            item: Number of the truth, by which sums are kept.
            truth: [H, W, 3] uint8
            gain: Of the camera, constant. [3]
        """
        if picture.tile_mask is None or picture.rest is None:
            return 0.0
        if item not in self._squares:
            self._squares[item] = self._backend.tile_squares(picture.rest, truth, gain.detach())
        return torch.where(picture.tile_mask, 0.0, self._squares[item]).sum() / truth.numel()

    def _frozen_view(self, view_row: int, view: View, rows: dict[str, Tensor]) -> _FrozenView | None:
        known = self._views.get(view_row)
        if known is None and not self._is_full:
            (role,) = self._constant
            k = self._model.decoder.gaussians_per_anchor
            seen = (rows[role][:, None] * k + torch.arange(k, device=rows[role].device)).reshape(-1)
            ends = (0.0, self._model.n_frames / self._model.clip_length) if self._model.has_light else (0.0,)
            with torch.no_grad():
                lit = [self._model.lit_gaussians(role, clip_time)[seen] for clip_time in ends]
                pictures = tuple(
                    self._valid.shown(view_row, render_gaussians(part, view, backend=self._backend).image[0])
                    for part in lit
                )
            gaussians = lit[0]
            boxes = self._boxes(gaussians, view)
            drawn = boxes.drawn()
            known = _FrozenView(pictures, seen[drawn], boxes[drawn], len(seen))
            self._is_full = self.n_bytes + known.n_bytes > self._max_bytes
            if self._is_full:
                return None
            self.n_bytes += known.n_bytes
            self._views[view_row] = known
        return known

    def _boxes(self, gaussians: Gaussians, view: View) -> TileBoxes:
        pose, K, size = view.world_to_camera, view.K, (view.width, view.height)
        return tile_boxes(gaussians, pose, K, *size, backend=self._backend, near_plane=view.near_plane)
