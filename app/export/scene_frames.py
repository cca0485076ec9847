"""SceneFrames: the one place where a moment of the trained scene is made for an export."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

from app.background.kernels import use_threads
from app.evaluation.headless import TrainedProject
from app.playback.contents import part_of
from engine.capture.clip import Clip
from engine.errors import ProjectError

if TYPE_CHECKING:
    from engine.metrics.clips.features_apart import Features
    from engine.metrics.clips.trained_clip import TrainedClip
    from engine.model.clip_model import ClipModel
    from engine.raster.gaussians import Gaussians

Part = Literal["all", "static", "moving"]
PARTS: tuple[Part, ...] = ("all", "static", "moving")
_CONTENTS = {"all": "all", "static": "static", "moving": "dynamic"}


class SceneFrames:
    """Gaussians of a project's frames, one loaded clip at a time: memory does not grow with the number of frames.

    Args:
        opened: A project opened for reading.
        n_threads: Threads to decode with; None for all.
        features: Which features of the anchors are used, see engine.metrics.clips.features_apart.
    """

    def __init__(self, opened: TrainedProject, *, n_threads: int | None = None, features: Features = "both") -> None:
        self.opened = opened
        self._n_threads = n_threads
        self._features: Features = features
        self._clip_of = [clip for clip in opened.clips for _ in clip.frame_indices()]
        self._loaded: TrainedClip | None = None
        self._parts: dict[Part, ClipModel] = {}

    @property
    def trained_frames(self) -> list[int]:
        """Frames of all finished clips, rising."""
        trained = set(self.opened.trained)
        return [frame for frame, clip in enumerate(self._clip_of) if clip.clip_index in trained]

    def check(self, frames: Iterable[float]) -> None:
        """See that all of these can be made, before anything is. Reads every clip once; keeps one at a time.

        Raises:
            ProjectError: There are none, one lies outside of the capture, or in a clip that is not trained or damaged.
        """
        for clip_index in self.check_trained(frames):
            self.opened.load(clip_index)

    def check_trained(self, frames: Iterable[float]) -> list[int]:
        """See that all of these are trained, without reading a clip. Returns the indices of their clips.

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
            ranges = [f"{start}:{stop}" for start, stop in _runs(self.trained_frames)]
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
        return self._clip_of[math.ceil(frame - 0.5)]

    def clip_time(self, frame: float) -> float:
        """Clip time of a moment in the clip that shows it."""
        clip = self.clip_at(frame)
        return (frame - clip.start) / clip.clip_length

    def trained(self, frame: float) -> TrainedClip:
        """The clip that shows a moment, loaded, for its colours and near plane.

        Raises:
            ProjectError: It is not trained or damaged, or the moment lies outside of the capture.
        """
        clip = self.clip_at(frame)
        if self._loaded is None or self._loaded.clip != clip:
            from engine.metrics.clips.features_apart import with_features

            use_threads(self._n_threads)
            loaded = self.opened.load(clip.clip_index)
            self._loaded, self._parts = replace(loaded, model=with_features(loaded.model, self._features)), {}
        return self._loaded

    def model(self, frame: float, part: Part = "all") -> ClipModel:
        """The part of the clip that shows a moment. Raises what `trained` raises."""
        trained = self.trained(frame)
        if part not in self._parts:
            self._parts[part] = part_of(trained.model, _CONTENTS[part])
        return self._parts[part]

    def gaussians(self, frame: float, part: Part = "all") -> Gaussians:
        """The scene at a moment, between frames too.

        Args:
            frame: In frames of the capture; its field is evaluated there.
            part: "static": what stands still in the whole clip, "moving": the rest, "all": both.
        Raises:
            ProjectError: What `trained` raises.
        """
        import torch

        with torch.no_grad():
            return self.model(frame, part).decode(self.clip_time(frame)).detach()


def _runs(frames: Sequence[int]) -> list[tuple[int, int]]:
    """Rising frames as runs without gaps: first, and one after the last."""
    runs: list[tuple[int, int]] = []
    for frame in frames:
        if runs and runs[-1][1] == frame:
            runs[-1] = (runs[-1][0], frame + 1)
        else:
            runs.append((frame, frame + 1))
    return runs
