"""Measures a stretch: how much it flickers, and how well its clips show what the cameras took."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from engine.capture.capture import Capture
from engine.mending.figures import StretchFigures
from engine.mending.stretch import Stretch
from engine.metrics.clips.evaluate import Evaluation
from engine.metrics.clips.seams import PairRow, score_of
from engine.metrics.clips.side_by_side import side_by_side
from engine.metrics.clips.summary import EvalRow, mean_of
from engine.metrics.clips.trained_clip import TrainedClip
from engine.parallel import n_cores

MAX_CAMERAS = 12
"""Training cameras that attempts are judged by, spread evenly: others of a large rig say the same."""


@dataclass(frozen=True, slots=True)
class Threads:
    """How many cameras are measured at a time, and the function called once on each of their threads."""

    n: int = 1
    prepare: Callable[[], object] = lambda: None


class StretchMeasuring:
    """Measures versions of the clips of one stretch; keeps the cameras' backgrounds in between.

    Args:
        capture: Its pictures are the truth.
        stretch: The stretch to mend.
        training_cameras: Indices of the cameras that clips are trained with.
        holdout: Of those that are not.
        threads: How it is spread.
    """

    def __init__(
        self,
        capture: Capture,
        stretch: Stretch,
        training_cameras: Sequence[int],
        holdout: Sequence[int],
        threads: Threads | None = None,
    ) -> None:
        self._stretch, self._holdout = stretch, sorted(holdout)
        every = list(training_cameras)
        chosen = np.linspace(0, len(every) - 1, min(len(every), MAX_CAMERAS)).round().astype(int)
        self._judging = [every[i] for i in chosen]
        self._threads = Threads(n_cores()) if threads is None else threads
        self._evaluation = Evaluation(
            capture, cameras=[*self._judging, *self._holdout], holdout=self._holdout, metrics="quick"
        )

    def measure(self, clips: Mapping[int, TrainedClip], *, with_held_out: bool = False) -> StretchFigures:
        """Figures of the stretch in some versions of its clips.

        Args:
            clips: By index: those of the stretch, and their neighbours where there are any.
            with_held_out: Whether cameras that were held out are measured, too.
        """
        cameras = [*self._judging, *(self._holdout if with_held_out else ())]
        rows: list[EvalRow] = []
        pairs: list[PairRow] = []
        work = (self._of_camera(clips, camera) for camera in cameras)
        for item in side_by_side(work, n_threads=self._threads.n, prepare=self._threads.prepare):
            if isinstance(item, PairRow):
                pairs.append(item)
            else:
                rows.append(item)
        own, held_out = ([row for row in pairs if row.is_held_out == group] for group in (False, True))
        changed = range(self._stretch.first, self._stretch.stop + 1)
        return StretchFigures(
            excess=self._excess(own),
            worst=_largest([row for row in own if row.frame_index in changed]),
            elsewhere=_largest([row for row in own if row.frame_index not in changed]),
            psnr=self._psnr(rows, is_held_out=False),
            held_out_excess=self._excess(held_out),
            held_out_psnr=self._psnr(rows, is_held_out=True),
        )

    def _of_camera(self, clips: Mapping[int, TrainedClip], camera: int):
        indices = self._stretch.clip_indices
        for index in indices:
            trained, before = clips[index], clips.get(index - 1)
            later = [f for f in trained.clip.frame_indices() if f > trained.clip.start or before is not None]
            frames = trained.clip.frame_indices()
            yield from self._evaluation.of_camera(trained, camera, before=before, frames=frames, pairs=later)
        behind = clips.get(indices[-1] + 1)
        if behind is not None:
            before, pairs = clips[indices[-1]], (behind.clip.start,)
            yield from self._evaluation.of_camera(behind, camera, before=before, frames=(), pairs=pairs)

    def _excess(self, rows: Sequence[PairRow]) -> float | None:
        """Mean over cameras and pairs of E, less the median of the other pairs inside the clips. 1/255"""
        asked = self._stretch.pairs
        found = []
        for camera in dict.fromkeys(row.camera for row in rows):
            of_camera = [row for row in rows if row.camera == camera]
            inside = [row for row in of_camera if not row.is_boundary and row.frame_index not in asked]
            normal = [row.excess_static for row in inside if row.excess_static is not None]
            found += [score_of(row.excess_static, normal) for row in of_camera if row.frame_index in asked]
        return mean_of(found)

    def _psnr(self, rows: Sequence[EvalRow], *, is_held_out: bool) -> dict[str, float]:
        found = {}
        for index in self._stretch.clip_indices:
            chosen = [row for row in rows if row.clip_index == index and row.is_held_out == is_held_out]
            mean = mean_of([row.figures["psnr"] for row in chosen])
            if mean is not None:
                found[str(index)] = mean
        return found


def _largest(rows: Sequence[PairRow]) -> float | None:
    """The largest mean over cameras of E on static pixels among these pairs, 1/255."""
    by_frame = [mean_of([row.excess_static for row in rows if row.frame_index == f]) for f in _frames(rows)]
    return max((255.0 * value for value in by_frame if value is not None), default=None)


def _frames(rows: Sequence[PairRow]) -> list[int]:
    return sorted({row.frame_index for row in rows})
