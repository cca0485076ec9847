"""SceneFrames: the one place where a moment of the trained scene is made for an export, edits included."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

from app.background.kernels import use_threads
from app.evaluation.headless import TrainedProject
from app.playback.modes.contents import part_of
from engine.capture.clip import Clip
from engine.capture.files.frame_runs import runs_of
from engine.editing.copies.copy_moments import CopyMoments, FrameCopies
from engine.editing.copies.object_copy import nearest_frame
from engine.editing.effects import EditStack, Effects
from engine.errors import ProjectError
from engine.timing.timing import SourceMoment

if TYPE_CHECKING:
    from engine.editing.clip_rows import NamedSet
    from engine.editing.copies.copied import Copier, CopySource
    from engine.editing.edited_clip import EditedClip, EditedGaussians
    from engine.metrics.clips.features_apart import Features
    from engine.metrics.clips.trained_clip import TrainedClip
    from engine.raster.gaussians import Gaussians

Part = Literal["all", "static", "moving"]
PARTS: tuple[Part, ...] = ("all", "static", "moving")
_CONTENTS = {"all": "all", "static": "static", "moving": "dynamic"}
MAX_LOADED = 3
"""Clips kept in memory: that of the moment, and those around it that copies come from."""


@dataclass(frozen=True, slots=True)
class Share:
    """One of the pictures that a moment between two frames is mixed of; a frame has one only.

    Attributes:
        weight: All weights of a moment add up to 1.
        trained: The clip, for its colours and near plane.
        clip_time: In it.
        gaussians: The Gaussians to draw.
    """

    weight: float
    trained: TrainedClip
    clip_time: float
    gaussians: Gaussians


@dataclass(slots=True)
class _Loaded:
    """A clip in memory, and its parts that were asked for. named: Its sets, see named_sets."""

    trained: TrainedClip
    named: dict[str, NamedSet]
    parts: dict[Part, EditedClip] = field(default_factory=dict)

    def part(self, part: Part) -> EditedClip:
        """A part of the clip, to be decoded."""
        from engine.editing.edited_clip import EditedClip

        if part not in self.parts:
            model = part_of(self.trained.model, _CONTENTS[part])
            self.parts[part] = EditedClip(model, self.trained.clip, self.named)
        return self.parts[part]


class SceneFrames:
    """Gaussians of a project's frames, a few loaded clips at a time: memory does not grow with the number of frames.

    Args:
        opened: A project opened for reading.
        n_threads: Threads to decode with; None for all.
        features: Which features of the anchors are used, see engine.metrics.clips.features_apart.
        edits: Edits to apply; None for the edits of the project, an empty stack for the scene as it was trained.
    """

    def __init__(
        self,
        opened: TrainedProject,
        *,
        n_threads: int | None = None,
        features: Features = "both",
        edits: EditStack | None = None,
    ) -> None:
        self.opened = opened
        self._edits = opened.project.document.stack() if edits is None else edits
        self._n_threads = n_threads
        self._features: Features = features
        self._clip_of = [clip for clip in opened.clips for _ in clip.frame_indices()]
        self._copies = CopyMoments(self._edits)
        self._copier: Copier | None = None
        self._loaded: OrderedDict[int, _Loaded] = OrderedDict()

    @property
    def trained_frames(self) -> list[int]:
        """Frames of all finished clips, rising."""
        trained = set(self.opened.trained)
        return [frame for frame, clip in enumerate(self._clip_of) if clip.clip_index in trained]

    def check(self, frames: Iterable[float]) -> None:
        """Check that all of these can be made, before anything is. Reads every clip once; keeps one at a time.

        Raises:
            ProjectError: There are none, one lies outside of the capture, or in a clip that is not trained or damaged.
        """
        for clip_index in self.check_trained(frames):
            self.opened.load(clip_index)

    def check_trained(self, frames: Iterable[float]) -> list[int]:
        """Check that all of these are trained, without reading a clip. Returns the indices of their clips.

        Raises:
            ProjectError: There are none, one lies outside of the capture, or in a clip that is not trained.
        """
        frames = list(frames)
        if not frames:
            raise ProjectError("There are no frames to export.", path=self.opened.project.folder)
        needed = list(dict.fromkeys(self.clip_at(frame).clip_index for frame in frames))
        trained = set(self.opened.trained)
        missing = [clip_index for clip_index in needed if clip_index not in trained]
        if missing:
            first = next(frame for frame in frames if self.clip_at(frame).clip_index in missing)
            ranges = [f"{run.start}:{run.stop}" for run in runs_of(self.trained_frames)]
            raise ProjectError(
                f"Frame {first:g} lies in clip {self.clip_at(first).clip_index}, which is not trained; of the "
                f"{len(needed)} clips asked for {len(missing)} {'is' if len(missing) == 1 else 'are'} not.",
                hint=f"Train with `clipgstream train` first, or take what is trained: --frames {' or '.join(ranges)}.",
                path=self.opened.project.folder,
            )
        return needed

    def clip_at(self, frame: float) -> Clip:
        """The clip that shows a moment: of its nearest frame, the earlier one half way.

        Raises:
            ProjectError: It lies outside of the capture.
        """
        if not (math.isfinite(frame) and 0 <= frame <= len(self._clip_of) - 1):
            raise ProjectError(
                f"There is no frame {frame:g}; the capture has frames 0 to {len(self._clip_of) - 1}.",
                path=self.opened.project.folder,
            )
        return self._clip_of[nearest_frame(frame)]

    def clip_time(self, frame: float) -> float:
        """Clip time of a moment in the clip that shows it."""
        clip = self.clip_at(frame)
        return (frame - clip.start) / clip.clip_length

    def trained(self, frame: float) -> TrainedClip:
        """The clip that shows a moment, loaded, for its colours and near plane.

        Raises:
            ProjectError: It is not trained or damaged, or the moment lies outside of the capture.
        """
        return self._load(self.clip_at(frame)).trained

    def _load(self, clip: Clip) -> _Loaded:
        if clip.clip_index not in self._loaded:
            from engine.metrics.clips.features_apart import with_features

            while len(self._loaded) >= (MAX_LOADED if self._edits.copies else 1):
                self._loaded.popitem(last=False)
            use_threads(self._n_threads)
            loaded = self.opened.load(clip.clip_index)
            named = self.opened.named_sets(loaded)
            trained = replace(loaded, model=with_features(loaded.model, self._features))
            self._loaded[clip.clip_index] = _Loaded(trained, named)
        self._loaded.move_to_end(clip.clip_index)
        return self._loaded[clip.clip_index]

    def _edited(
        self, frame: float, clip_time: float, effects: Effects, part: Part, *, alive_at: float | None = None
    ) -> EditedGaussians:
        """A part of the clip that shows a moment, once edited. Raises as `trained` does."""
        return self._load(self.clip_at(frame)).part(part).decode(clip_time, effects, alive_at=alive_at)

    def effects(self, frame: float, shown_by: int | None = None) -> Effects:
        """Of the edits that hold at a moment: between two frames those of the frame before.

        Args:
            shown_by: A frame of the clip that shows the moment; None for the nearest one.
        """
        shown = nearest_frame(frame) if shown_by is None else shown_by
        is_of_next = self.clip_at(shown).clip_index != self.clip_at(math.floor(frame)).clip_index
        return self._edits.at(frame, shown if is_of_next else None)

    def copies(self, frame: float) -> FrameCopies:
        """Copies of objects at a moment."""
        return self._copies.at(frame)

    def _with_copies(self, edited: EditedGaussians, frame: float) -> EditedGaussians:
        """A moment and its copies; those from clips that are not trained are missing. Raises as `trained` does."""
        copies = self.copies(frame)
        return self._made_copier().with_copies(edited, copies, self._copied_clip) if copies else edited

    def copied(self, frame: float) -> Gaussians | None:
        """The copies of a moment alone; None where there are none. Raises as `trained` does."""
        return self._made_copier().gaussians(self.copies(frame), self._copied_clip)

    def _made_copier(self) -> Copier:
        if self._copier is None:
            from engine.editing.copies.copied import Copier

            self._copier = Copier()
        return self._copier

    def _copied_clip(self, frame: float) -> CopySource | None:
        from engine.editing.copies.copied import CopySource

        at = nearest_frame(frame)
        clip = self._clip_of[at] if 0 <= at < len(self._clip_of) else None
        if clip is None or clip.clip_index not in self.opened.trained:
            return None
        return CopySource(clip.clip_index, lambda: self._load(clip).part("all"))

    def gaussians(self, frame: float, part: Part = "all") -> Gaussians:
        """The scene at a moment, between frames too.

        Args:
            frame: In frames of the capture; its field is evaluated there.
            part: "static": still parts of the whole clip, "moving": the rest and all copies, "all": both.
        Raises:
            ProjectError: As `trained`; an edit is damaged.
        """
        return self.edited(frame, part).gaussians

    def edited(self, frame: float, part: Part = "all") -> EditedGaussians:
        """The same with the rows that Gaussians come from. Raises as `gaussians` does."""
        edited = self._edited(frame, self.clip_time(frame), self.effects(frame), part)
        return edited if part == "static" else self._with_copies(edited, frame)

    def at_moments(self, moments: Sequence[SourceMoment], part: Part = "all") -> Gaussians:
        """The scene at moments that fade into each other: still parts of the one that most is seen of, and what moves
        at all of them, as faint as their weights say. `part` as of `gaussians`; raises as that does."""
        from engine.raster.gaussians import Gaussians

        main = max(moments, key=lambda moment: moment.weight)
        if len(moments) == 1 or part == "static":
            return self.gaussians(main.frame, part)
        found = [self.gaussians(main.frame, "static")] if part == "all" else []
        for moment in moments:
            moving = self.gaussians(moment.frame, "moving")
            found.append(replace(moving, opacities=moving.opacities * moment.weight))
        return Gaussians.concatenate([replace(one, is_frozen=None) for one in found])

    def shares(self, frame: float) -> Iterator[Share]:
        """The parts of a moment's picture, to be drawn one by one and mixed by weight.

        Anchors of moving things exist at some frames only, and a clip ends with its last frame. Between two frames the
        field is evaluated at the moment itself and anchors travel there, but what exists at the frame before fades out
        while what exists at the frame after fades in; all at once it would be seen twice. Between two clips the last
        frame of the one fades into the first frame of the other, where both are trained, and both travel to the moment:
        0.6 dB better of moving pixels than frames that stand (a scene with truth between frames).

        Raises:
            ProjectError: As `trained`.
        """
        before = math.floor(frame)
        fraction = frame - before
        if fraction > 0 and self.clip_at(before) != self.clip_at(before + 1):
            weights = {before: 1.0 - fraction, before + 1: fraction}
            finished = self.opened.trained
            known = {at: weight for at, weight in weights.items() if self.clip_at(at).clip_index in finished}
            is_loaded = {at: self.clip_at(at).clip_index in self._loaded for at in known}
            for at in sorted(known, key=lambda at: not is_loaded[at]):  # each clip is loaded once
                trained, clip_time = self.trained(at), self.clip_time(at)
                there = (frame - trained.clip.start) / trained.clip.clip_length  # may be outside of it
                edited = self._edited(at, there, self.effects(frame, at), "all", alive_at=clip_time)
                yield Share(
                    known[at] / sum(known.values()), trained, clip_time, self._with_copies(edited, frame).gaussians
                )
            return
        trained, clip_time = self.trained(frame), self.clip_time(frame)
        knots, effects = trained.model.knots(clip_time), self.effects(frame)
        for knot, weight in knots:
            alive_at = None if len(knots) == 1 else knot / trained.clip.clip_length
            edited = self._edited(frame, clip_time, effects, "all", alive_at=alive_at)
            yield Share(weight, trained, clip_time, self._with_copies(edited, frame).gaussians)
