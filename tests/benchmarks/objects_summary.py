"""What the program finds of an object from one lasso, and from one or two more: figures and rows of a table."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from app.evaluation.headless import TrainedProject
from engine.editing.clip_rows import named_sets
from engine.editing.edit import Picked
from engine.editing.edited_clip import EditedClip
from engine.editing.scene_object import SceneObject
from engine.editing.selection.seen_from import SeenFrom
from engine.objects.finding import SearchedClip, find_object
from tests.documents.table import table
from tests.objects_truth.correcting import correction
from tests.objects_truth.measuring import ClipFigures, clip_figures, views_of
from tests.objects_truth.selecting import lasso_seed
from tests.objects_truth.truth import ObjectsTruth

PicksOf = Callable[[EditedClip, dict[str, SeenFrom]], tuple[Picked, str]]
"""The picks of a clip, and a note for the table."""


@dataclass(frozen=True, slots=True)
class Found:
    """An object after one search.

    Attributes:
        n_corrections: So many lassos followed the first one.
        clips: Figures and a note of each clip.
        search_s: What the search took, loading of clips included.
        n_bytes: What a clip of the object takes in the document, on average.
    """

    n_corrections: int
    clips: list[tuple[ClipFigures, str]]
    search_s: float
    n_bytes: float

    @property
    def ious(self) -> list[float]:
        """Of the clips that show the object."""
        return [clip.iou for clip, _ in self.clips if clip.iou is not None]

    @property
    def left(self) -> float:
        """Share of the object, over all clips, that deletion leaves."""
        return sum(clip.n_left for clip, _ in self.clips) / max(sum(clip.n_clear for clip, _ in self.clips), 1)

    @property
    def lost(self) -> float:
        """Share of other objects, over all clips, that deletion takes."""
        return sum(clip.n_lost for clip, _ in self.clips) / max(sum(clip.n_others for clip, _ in self.clips), 1)


def edited_clip(opened: TrainedProject, clip_index: int) -> tuple[EditedClip, float]:
    """A trained clip of a project, and its near plane."""
    trained = opened.load(clip_index)
    named = named_sets(trained.model, opened.header(clip_index), opened.project.settings.reference_clip)
    return EditedClip(trained.model, trained.clip, named), trained.base.header.near_plane


def measured(
    opened: TrainedProject, truth: ObjectsTruth, name: str, picks_of: PicksOf, *, every: int = 1
) -> Iterator[tuple[ClipFigures, str]]:
    """Clip by clip. every: See `clip_figures`."""
    for clip_index in opened.trained:
        edited, near = edited_clip(opened, clip_index)
        views = views_of(truth, opened.rig, near=near)
        picked, note = picks_of(edited, views)
        yield clip_figures(edited, views, truth, name, picked, every=every), note


def searches(
    opened: TrainedProject,
    truth: ObjectsTruth,
    name: str,
    *,
    frame_index: int,
    seen_from: str | None = None,
    n_corrections: int = 0,
    every: int = 1,
) -> Iterator[Found]:
    """What is found from a lasso in one frame, then from that and one correction in the worst clip, and so on.

    Args:
        opened: The project.
        truth: Of the capture.
        name: Of the object.
        frame_index: In which it is selected.
        seen_from: The camera from which it is selected; None for all evaluated ones. See `lasso_seed`.
        n_corrections: See `correction`.
        every: See `clip_figures`.
    """
    clips = {i: edited_clip(opened, i)[0].clip for i in opened.trained}
    searched = [SearchedClip(clip, lambda i=i: edited_clip(opened, i)[0]) for i, clip in clips.items()]
    first = next(i for i, clip in clips.items() if clip.start <= frame_index < clip.stop)
    edited, near = edited_clip(opened, first)
    views = views_of(truth, opened.rig, near=near)
    chosen = views if seen_from is None else {seen_from: views[seen_from]}
    seeds = (lasso_seed(edited, chosen, truth, name, frame_index),)
    while True:
        began_s = time.perf_counter()
        found = find_object(SceneObject(0, name, seeds=seeds), searched)
        search_s = time.perf_counter() - began_s
        by_start = {one.start: one for one in found}

        def picks(edited: EditedClip, views: dict[str, SeenFrom], by_start: dict = by_start) -> tuple[Picked, str]:
            one = by_start[edited.clip.start]
            return Picked(one.sets), f"{one.confidence:.2f} {one.doubt}"

        figures = list(measured(opened, truth, name, picks, every=every))
        n_bytes = float(np.mean([len(msgspec.json.encode(one)) for one in found]))
        yield Found(len(seeds) - 1, figures, search_s, n_bytes)
        if len(seeds) > n_corrections:
            return
        worst = min((clip for clip, _ in figures if clip.iou is not None), key=lambda clip: clip.iou or 0.0)
        edited, near = edited_clip(opened, worst.clip_index)
        views = views_of(truth, opened.rig, near=near)
        seeds = (*seeds, correction(edited, views, truth, name, picks(edited, views)[0], every=every))


Row = tuple[str, str, Sequence[Found]]
"""Name of the capture, of the object, and what each search found."""


def summary(rows: Sequence[Row]) -> str:
    """One row per object; cells of several figures are of searches one after the other, or of all and of the worst."""
    n_corrections = max(len(found) for *_, found in rows) - 1
    later = [f"with {n} correction{'s' if n > 1 else ''}" for n in range(1, n_corrections + 1)]
    header = (
        "capture", "object", "clips", "IoU % from one lasso: mean, worst clip", *later,
        "left %", "others lost %", "search s", "kB a clip",
    )  # fmt: skip
    return table(header, [_summed(*row) for row in rows])


def _summed(capture: str, name: str, found: Sequence[Found]) -> tuple[str, ...]:
    return (
        capture,
        name,
        str(len(found[0].clips)),
        *(f"{100 * np.mean(one.ious):.1f}, {100 * min(one.ious):.1f}" for one in found),
        ", ".join(f"{100 * one.left:.1f}" for one in found),
        ", ".join(f"{100 * one.lost:.1f}" for one in found),
        f"{found[0].search_s:.1f}",
        f"{found[-1].n_bytes / 1e3:.1f}",
    )
