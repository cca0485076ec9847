"""find_fill: the fill of an edit that takes something away."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from msgspec.structs import replace

from engine.backends.backend import Backend
from engine.capture.clip import Clip
from engine.editing.actions import Delete, Hide
from engine.editing.edit import Edit, Fill, PickedRows
from engine.editing.edited_clip import EditedClip
from engine.editing.effects import EditStack
from engine.editing.fills.fill import fill_key, packed_fill
from engine.editing.picks import pack_rows
from engine.editing.selection.seen_from import SeenFrom
from engine.errors import ProjectError
from engine.filling.pictures import HALF, Taken, draw, holes_of, taken_away
from engine.filling.surface import surface_behind
from engine.filling.traces import CELL_SPACINGS, Swept
from engine.model.host_array import host_array
from engine.raster.gaussians import Gaussians

CELL_SHARE = 0.1
"""Smallest distance of new Gaussians, in spacings of the static anchors; a picture has larger pixels as a rule."""
MAX_MOMENTS = 8
"""Frames that are looked at for holes, spread over those in which the edit holds."""


@dataclass(frozen=True, slots=True)
class FilledClip:
    """A trained clip to look at.

    Attributes:
        clip: Its frames.
        load: Loads it; called a few times, and what it returns is let go of soon.
        spacing: Of its static anchors, scene units.
    """

    clip: Clip
    load: Callable[[], EditedClip]
    spacing: float


@dataclass(frozen=True, slots=True)
class FillFigures:
    """What was found.

    Attributes:
        n_traces: Still Gaussians that go with what was taken away.
        n_gaussians, n_guessed: New ones, and those of them that no camera ever saw anything of.
        n_pixels: Pixels, over all pictures that were looked at, that showed what was taken away.
        n_open: Those of them that were holes without the fill.
        n_left: Those that new Gaussians do not cover.
    """

    n_traces: int
    n_gaussians: int
    n_guessed: int
    n_pixels: int
    n_open: int
    n_left: int


def find_fill(
    edit: Edit,
    stack: EditStack,
    clips: Sequence[FilledClip],
    views: Sequence[SeenFrom],
    *,
    up: np.ndarray,
    backend: Backend,
    report: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[Fill, FillFigures]:
    """Fill what was behind something that an edit takes away. Pure and slow: seconds a clip.

    Args:
        edit: Of the stack; it deletes or hides.
        stack: All edits.
        clips: The trained ones, in order of time.
        views: Cameras to look from.
        up: Up direction of the scene. [3]
        backend: Draws.
        report: Told how many steps of how many are done; what it raises ends the work.
    Raises:
        ProjectError: The edit takes nothing away, in no trained frame, or from no Gaussian.
    """
    if not isinstance(edit.action, Delete | Hide):
        raise ProjectError(f"Edit {edit.edit_id} takes nothing away.", hint="Choose an edit that deletes or hides.")
    held = [(one, [frame for frame in one.clip.frame_indices() if edit.scope.holds_at(frame)]) for one in clips]
    held = [(one, frames) for one, frames in held if frames]
    if not held:
        raise ProjectError(f"Edit {edit.edit_id} acts in no frame that is trained.", hint="Train its clips first.")
    search = _Search(replace(edit, fill=None, is_on=True), stack, up / np.linalg.norm(up), backend)
    moments = _spread(held)
    n_steps = len(held) + len(moments) * len(views) + 1
    traces: dict[tuple[int, str, str], np.ndarray] = {}
    swept = Swept(CELL_SPACINGS * float(np.median([one.spacing for one, _ in held])), search.up)
    for done, (one, frames) in enumerate(held):
        report(done, n_steps)
        search.note(one.load(), frames, swept)
    is_anything, pictures = False, []
    for one, frames in _by_clip(moments):
        loaded = one.load()
        found = search.traces(loaded, frames[0], swept)
        for key, rows in found.items():  # clips share their still part, in other light
            traces[key] = np.union1d(traces.get(key, rows), rows)
        for frame in frames:
            before, is_gone, n_still = search.taken(loaded, frame, _packed(found))
            is_anything |= bool(is_gone.any())
            for view in views:
                report(len(held) + len(pictures), n_steps)
                pictures.append(taken_away(before, is_gone, n_still, view, backend))
    if not is_anything:
        raise ProjectError(f"Edit {edit.edit_id} takes nothing away in any trained frame.")
    holes = holes_of(pictures)
    surface = surface_behind(pictures, holes, float(np.median([one.spacing for one, _ in held])) * CELL_SHARE)
    fill = Fill(fill_key(edit), _packed(traces), packed_fill(surface))
    columns = (surface.means, surface.quats, surface.scales, surface.opacities, surface.colors)
    drawn = Gaussians(*(torch.from_numpy(column).to(backend.device, backend.dtype) for column in columns))
    report(n_steps, n_steps)
    return fill, FillFigures(
        n_traces=sum(len(rows) for rows in traces.values()),
        n_gaussians=len(surface),
        n_guessed=int(surface.is_guess.sum()),
        n_pixels=sum(int(picture.is_open.sum()) for picture in pictures),
        n_open=sum(int(is_hole.sum()) for is_hole in holes),
        n_left=_n_left(drawn, pictures, holes, backend),
    )


class _Search:
    """One edit, and what is below it."""

    def __init__(self, edit: Edit, stack: EditStack, up: np.ndarray, backend: Backend) -> None:
        self.edit, self.up, self._backend = edit, up, backend
        place = next(row for row, one in enumerate(stack.edits) if one.edit_id == edit.edit_id)
        self._below = EditStack(stack.edits[:place], stack.objects)
        self._with = EditStack((*stack.edits[:place], edit), stack.objects)
        self._objects = stack.objects

    def note(self, loaded: EditedClip, frames: Sequence[int], swept: Swept) -> None:
        """Note where the moving part of what is taken away is in all frames of a clip."""
        for frame in frames:
            gaussians, is_gone, n_still = self._gone(loaded, frame)
            rows = np.flatnonzero(is_gone)
            rows = rows[rows >= n_still]
            means, opacities, colors = (host_array(value)[rows] for value in _looks(gaussians))
            swept.add(means.astype(np.float64), opacities, colors)

    def traces(self, loaded: EditedClip, frame: int, swept: Swept) -> dict[tuple[int, str, str], np.ndarray]:
        """Still Gaussians that are traces: numbers by clip, origin and role."""
        clip_time = loaded.clip.clip_time(frame)
        edited = loaded.decode(clip_time, self._with.at(frame))
        means, _, colors = (host_array(value)[: edited.n_still] for value in _looks(edited.gaussians))
        found = np.flatnonzero(swept.is_trace(means.astype(np.float64), colors))
        rows = edited.rows[found]
        out: dict[tuple[int, str, str], np.ndarray] = {}
        for place in np.unique(rows.set_index):
            row_set = rows.sets[place]
            out[row_set.clip_index, row_set.origin, row_set.role] = np.unique(rows.number[rows.set_index == place])
        return out

    def taken(
        self, loaded: EditedClip, frame: int, traces: tuple[PickedRows, ...]
    ) -> tuple[Gaussians, np.ndarray, int]:
        """The Gaussians of a moment below the edit, which of them it and its traces take away [N] bool, and how many
        stand still."""
        filling = Fill(fill_key(self.edit), traces)
        return self._gone(
            loaded, frame, EditStack((*self._below.edits, replace(self.edit, fill=filling)), self._objects)
        )

    def _gone(
        self, loaded: EditedClip, frame: int, stack: EditStack | None = None
    ) -> tuple[Gaussians, np.ndarray, int]:
        clip_time = loaded.clip.clip_time(frame)
        before = loaded.decode(clip_time, self._below.at(frame))
        after = loaded.decode(clip_time, (stack or self._with).at(frame))
        is_left = np.zeros(loaded.rows.n, bool)
        is_left[loaded.rows.indices_of(after.rows)] = True
        index = loaded.rows.indices_of(before.rows)
        is_gone = np.zeros(len(before.rows), bool)  # fills of edits below stay
        is_gone[: len(index)] = ~is_left[index]
        return before.gaussians, is_gone, before.n_still


def _looks(gaussians: Gaussians) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Centres, opacities and colours."""
    return gaussians.means, gaussians.opacities, gaussians.colors


def _packed(traces: dict[tuple[int, str, str], np.ndarray]) -> tuple[PickedRows, ...]:
    return tuple(PickedRows(clip, origin, role, pack_rows(rows)) for (clip, origin, role), rows in traces.items())


def _spread(held: Sequence[tuple[FilledClip, list[int]]]) -> list[tuple[FilledClip, int]]:
    """Moments spread evenly over the frames in which an edit holds, first and last included."""
    every = [(one, frame) for one, frames in held for frame in frames]
    chosen = np.unique(np.linspace(0, len(every) - 1, min(MAX_MOMENTS, len(every))).round().astype(int))
    return [every[row] for row in chosen]


def _by_clip(moments: Sequence[tuple[FilledClip, int]]) -> list[tuple[FilledClip, list[int]]]:
    found: list[tuple[FilledClip, list[int]]] = []
    for one, frame in moments:
        if not found or found[-1][0] is not one:
            found.append((one, []))
        found[-1][1].append(frame)
    return found


def _n_left(surface: Gaussians, pictures: Sequence[Taken], holes: Sequence[np.ndarray], backend: Backend) -> int:
    """Pixels of holes that new Gaussians do not cover."""
    n, alphas = 0, {}
    for one, is_hole in zip(pictures, holes, strict=True):
        if is_hole.any():
            alpha = alphas.get(id(one.view))
            if alpha is None:
                alpha = alphas[id(one.view)] = draw(surface, one.view, backend).alpha
            n += int((is_hole & (alpha < HALF)).sum())
    return n
