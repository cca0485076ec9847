"""Copier: appends the copies of a moment to its Gaussians: for the window as for exports."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from engine.byte_cache import ByteCache
from engine.editing.actions import FAR, Transform
from engine.editing.changed_gaussians import transformed
from engine.editing.copies.copy_moments import CopyOfMoment, FrameCopies, ObjectMoment
from engine.editing.copies.object_copy import nearest_frame
from engine.editing.edited_clip import EditedClip, EditedGaussians
from engine.editing.gaussian_rows import with_copied
from engine.model.host_array import host_array
from engine.raster.gaussians import Gaussians

KEPT_BYTES = 64 << 20
"""Objects at moments that are kept: copies that follow each other in time, and the next frame, ask for them again."""


@dataclass(frozen=True, slots=True)
class CopySource:
    """A clip that copies come from.

    Attributes:
        key: The same for the same state of the same clip.
        load: Gives the clip; called only where something of it is not known yet.
    """

    key: Hashable
    load: Callable[[], EditedClip]


ClipAt = Callable[[float], CopySource | None]
"""The clip that shows a moment, see `nearest_frame`; None where it is not trained."""


class Copier:
    """For one thread."""

    def __init__(self) -> None:
        self._kept: ByteCache[Hashable, Gaussians] = ByteCache(KEPT_BYTES)
        self._whole: tuple[Hashable, EditedClip, EditedGaussians] | None = None

    @torch.no_grad()
    def with_copies(self, edited: EditedGaussians, copies: FrameCopies, clip_at: ClipAt) -> EditedGaussians:
        """Gaussians of a moment, and its copies after them.

        Args:
            edited: The moment without copies.
            copies: Of the moment.
            clip_at: Gives the clips that they come from.
        Raises:
            ProjectError: A clip is damaged, or an edit.
        """
        found = self.gaussians(copies, clip_at)
        if found is None:
            return edited
        together = Gaussians.concatenate([edited.gaussians, found])
        return replace(edited, gaussians=together, rows=with_copied(edited.rows, len(found)))

    @torch.no_grad()
    def gaussians(self, copies: FrameCopies, clip_at: ClipAt) -> Gaussians | None:
        """The copies alone, in their order; None where there are none. Arguments and errors as of `with_copies`."""
        found = [self._copy(copy, clip_at) for copy in copies.all]
        parts = [part for part in found if part is not None and len(part)]
        self._whole = None
        return Gaussians.concatenate(parts) if parts else None

    def _copy(self, copy: CopyOfMoment, clip_at: ClipAt) -> Gaussians | None:
        found = self._object(copy.source, clip_at)
        if found is None or not len(found):
            return None
        everything = torch.ones(len(found), dtype=torch.bool, device=found.means.device)
        for move in (*copy.moves, *self._carried(copy, clip_at)):
            found = transformed(found, everything, move)
        return found

    def _carried(self, copy: CopyOfMoment, clip_at: ClipAt) -> Iterator[Transform]:
        """How far the object has come that carries the copy; nothing where that is not there."""
        middles = [self._middle(one, clip_at) for one in copy.follows or ()]
        if len(middles) == 2 and middles[0] is not None and middles[1] is not None:
            x, y, z = (float(value) for value in np.clip(middles[1] - middles[0], -FAR, FAR))
            yield Transform((x, y, z))

    def _middle(self, moment: ObjectMoment, clip_at: ClipAt) -> np.ndarray | None:
        found = self._object(moment, clip_at)
        return None if found is None else middle_of(found)

    def _object(self, moment: ObjectMoment, clip_at: ClipAt) -> Gaussians | None:
        """An object at a moment, where it is then; None where its clip is not trained."""
        source = clip_at(moment.frame)
        if source is None:
            return None
        key = (source.key, moment.digest)
        known = self._kept.get(key)
        if known is None:
            clip, whole = self._decoded(source, moment)
            is_meant = _is_picked(clip, whole, moment)
            known = replace(whole.gaussians, is_frozen=None)[is_meant]
            self._kept.put(key, known, sum(tensor.nbytes for tensor in known.tensors()))
        return known

    def _decoded(self, source: CopySource, moment: ObjectMoment) -> tuple[EditedClip, EditedGaussians]:
        """All of a clip at a moment. The last one is kept: objects are often copied together.

        Between two frames only what exists at the nearer one is decoded: with both, an object is seen twice where its
        anchors exist for a frame each.
        """
        key = (source.key, moment.frame, moment.effects.digest)
        if self._whole is None or self._whole[0] != key:
            edited = source.load()
            position = min(max(moment.frame - edited.clip.start, 0.0), edited.clip.n_frames - 1.0)
            clip_time, alive_at = (at / edited.clip.clip_length for at in (position, nearest_frame(position)))
            self._whole = key, edited, edited.decode(clip_time, moment.effects, alive_at=alive_at)
        return self._whole[1:]


def middle_of(gaussians: Gaussians) -> np.ndarray | None:
    """The middle of an object, whatever few Gaussians far off it may have; None where nothing is there. [3] float64"""
    means = host_array(gaussians.means).astype(np.float64)
    means = means[np.isfinite(means).all(axis=1)]
    return np.median(means, axis=0) if len(means) else None


def _is_picked(clip: EditedClip, whole: EditedGaussians, moment: ObjectMoment) -> Tensor:
    chosen = clip.rows.is_picked(moment.picked)[clip.rows.indices_of(whole.rows)]
    return torch.from_numpy(chosen).to(whole.gaussians.means.device)
