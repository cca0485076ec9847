"""Stretches of a scene: frames of an export that share a clip and its edits, as files over time take them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from app.export.scene_frames import SceneFrames
from app.export.take import TakeFrame
from engine.editing.gaussian_rows import RowSet
from engine.export.player.blocks import joined
from engine.export.player.still_part import shapes
from engine.export.sequences.sequence import MovingSplats, SequenceStretch
from engine.export.splats import Splats
from engine.export.world import FileWorld

SAME_LIGHT = 1.5 / 255.0
"""Still Gaussians whose colours change by more than this within a stretch count as moving; others get the middle."""


class SceneStretches:
    """The stretches of an export. Memory holds a clip, or those that its moments fade between.

    Args:
        scene: The source of frames.
        frames: At least one.
        world: The scene's place in the file.
        told: Called before each frame is made, with the number of frames made.

    Attributes:
        n_dropped: Rows that cannot be drawn and were left out, of the stretches so far.
    """

    def __init__(
        self, scene: SceneFrames, frames: Sequence[TakeFrame], world: FileWorld, told: Callable[[int], None]
    ) -> None:
        self._scene, self._frames, self._world, self._told = scene, frames, world, told
        self.n_dropped = 0

    def __iter__(self) -> Iterator[SequenceStretch]:
        begin = 0
        for end in range(1, len(self._frames) + 1):
            if end == len(self._frames) or self._kind(end) != self._kind(begin):
                yield self._stretch(begin, end)
                begin = end

    def _kind(self, number: int) -> object:
        frame = self._frames[number].frame
        return self._scene.clip_at(frame).clip_index, self._scene.effects(frame)

    def _stretch(self, begin: int, end: int) -> SequenceStretch:
        still = self._still(begin)
        self.n_dropped += still.n_dropped
        is_same = np.ones(len(still), bool)
        lowest = highest = still.colors
        for number in range(begin + 1, end):
            other = self._still(number)
            if len(other) != len(still):  # then row for row says nothing
                still, is_same = still[:0], np.zeros(0, bool)
                break
            is_same &= (shapes(still) == shapes(other)).all(1)
            lowest, highest = np.minimum(lowest, other.colors), np.maximum(highest, other.colors)
        else:
            is_same &= (highest - lowest).max(1, initial=0.0) <= SAME_LIGHT
            still = replace(still, colors=0.5 * (lowest + highest))
        names: dict[tuple[int, RowSet], int] = {}
        return SequenceStretch(begin, end - begin, still[is_same], lambda number: self._moving(number, is_same, names))

    def _still(self, number: int) -> Splats:
        return self._world.placed(Splats.of(self._scene.gaussians(self._frames[number].frame, "static")))

    def _moving(self, number: int, is_still: np.ndarray, names: dict[tuple[int, RowSet], int]) -> MovingSplats:
        """What moves at a frame, and the rest of its still part.

        Args:
            is_still: Rows of the still part that the stretch has; there may be more rows.
            names: Numbers of the sets of rows seen so far.
        """
        self._told(number)
        moments = self._frames[number].moments
        parts: list[Splats] = []
        ids: list[np.ndarray] = []
        for place, moment in enumerate(moments):
            edited = self._scene.edited(moment.frame, "moving")
            gaussians = edited.gaussians
            if len(moments) > 1:
                gaussians = replace(gaussians, opacities=gaussians.opacities * moment.weight)
            splats, is_kept = Splats.with_kept(*(tensor.numpy() for tensor in gaussians.tensors()))
            sets = np.array([names.setdefault((place, one), len(names)) for one in edited.rows.sets], np.int64)
            parts.append(splats)
            ids.append(((sets[edited.rows.set_index] << 32) + edited.rows.number)[is_kept])
            self.n_dropped += splats.n_dropped
        moving = self._world.placed(joined(*parts))
        if len(is_still) and is_still.all():
            return MovingSplats(moving, np.concatenate(ids))
        still = self._still(number)
        rows = np.setdiff1d(np.arange(len(still)), np.flatnonzero(is_still))
        return MovingSplats(joined(moving, still[rows]), np.concatenate([*ids, -1 - rows]))
