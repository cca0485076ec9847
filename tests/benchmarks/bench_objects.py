"""How well are objects followed? IoU of picks with true masks, clip by clip, and what deleting them leaves and takes.

    python -m tests.benchmarks.bench_objects --write out/objects           # captures and masks of all scenes
    python -m tests.benchmarks.bench_objects PROJECT MASKS                  # what the best possible picks reach
    python -m tests.benchmarks.bench_objects PROJECT MASKS --edit 3 --object person_a
    python -m tests.benchmarks.bench_objects PROJECT tests/objects_truth/basketball_boxes.json

Masks are those that `--write` leaves next to each capture, or made from volumes in the held-out cameras. Without
`--edit` picks come from the masks themselves (the oracle): no picks of one label per Gaussian and clip do much better.
"Left" is the share of the object that still shows something moving after deletion, "others lost" the share of the other
objects that goes with it; "roles" is what the object's pixels are made of.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from app.evaluation.headless import TrainedProject, open_trained
from app.project.opening.project_access import open_project
from engine.editing.clip_rows import named_sets
from engine.editing.edit import Picked
from engine.editing.edited_clip import EditedClip
from engine.editing.selection.seen_from import SeenFrom
from engine.storage.json_files import json_text
from tests.benchmarks.options import ending_on_bad_input
from tests.documents.table import table
from tests.objects_truth.measuring import ClipFigures, clip_figures, views_of
from tests.objects_truth.oracle import find_oracle, picked_rows
from tests.objects_truth.scene import SCENARIOS, make_object_scene
from tests.objects_truth.truth import ObjectsTruth, read_truth, write_object_capture
from tests.objects_truth.volumes import read_volumes, truth_in_volumes

PicksOf = Callable[[EditedClip, dict[str, SeenFrom]], tuple[Picked, dict[str, float]]]
"""The picks of a clip, and the roles that its pixels are made of where that is known."""


def edited_clips(opened: TrainedProject) -> Iterator[tuple[EditedClip, float]]:
    """The trained clips of a project, and the near plane of each."""
    for clip_index in opened.trained:
        trained = opened.load(clip_index)
        named = named_sets(trained.model, opened.header(clip_index), opened.project.settings.reference_clip)
        yield EditedClip(trained.model, trained.clip, named), trained.base.header.near_plane


def oracle_of(truth: ObjectsTruth, name: str) -> PicksOf:
    """The picks that the masks themselves say."""

    def picks(edited: EditedClip, views: dict[str, SeenFrom]) -> tuple[Picked, dict[str, float]]:
        oracle = find_oracle(edited, views, truth, name)
        return Picked(picked_rows(edited, oracle.is_object)), oracle.weights

    return picks


def truth_of(path: Path, opened: TrainedProject) -> ObjectsTruth:
    """Masks from their folder, or for a project from a file of volumes."""
    if path.suffix != ".json":
        return read_truth(path)
    views, clips = {}, list(edited_clips(opened))
    for camera in opened.project.settings.holdout:
        i = opened.rig.names.index(camera)
        width, height = (int(side) for side in opened.rig.image_sizes[i])
        views[camera] = SeenFrom(opened.rig.world_to_camera[i], opened.rig.Ks[i], width, height, clips[0][1])
    return truth_in_volumes((clip for clip, _ in clips), views, read_volumes(path))


def measured(
    opened: TrainedProject, truth: ObjectsTruth, name: str, picks_of: PicksOf
) -> Iterator[tuple[ClipFigures, dict[str, float]]]:
    """Clip by clip."""
    for edited, near in edited_clips(opened):
        views = views_of(truth, opened.rig, near=near)
        picked, weights = picks_of(edited, views)
        yield clip_figures(edited, views, truth, name, picked), weights


def mean_iou(figures: list[ClipFigures]) -> float:
    """Over the clips that show the object."""
    return float(np.mean([clip.iou for clip in figures if clip.iou is not None]))


def report(found: list[tuple[ClipFigures, dict[str, float]]]) -> str:
    """The table of an object."""
    rows = [
        (
            str(clip.clip_index), _percent(clip.iou), _percent(clip.lowest), str(clip.n_true),
            str(clip.n_drawn - clip.n_both), _percent(clip.left), _percent(clip.lost),
            ", ".join(f"{role} {weight:.2f}" for role, weight in weights.items()),
        )
        for clip, weights in found
    ]  # fmt: skip
    header = ("clip", "IoU %", "worst frame", "true px", "wrong px", "left %", "others lost %", "roles")
    return table(header, rows) + f"\nmean IoU {100 * mean_iou([clip for clip, _ in found]):.1f} %"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.1f}"


def main(argv: list[str] | None = None) -> None:
    """Print the tables; see the module docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("project", type=Path, nargs="?")
    parser.add_argument("masks", type=Path, nargs="?")
    parser.add_argument("--write", type=Path, metavar="FOLDER", help="write captures and masks instead")
    parser.add_argument("--object", help="its name; all by default")
    parser.add_argument("--edit", type=int, metavar="ID", help="measure the picks of this edit of the project")
    parser.add_argument("--json", type=Path, help="also write all figures here")
    options = parser.parse_args(argv)
    if options.write:
        for scenario in SCENARIOS:
            folder = options.write / scenario
            write_object_capture(folder, options.write / f"{scenario}-masks", make_object_scene(scenario))
            print(folder)
        return
    if options.project is None or options.masks is None:
        parser.error("name a project and its masks, or --write FOLDER")
    with ending_on_bad_input():
        opened = open_trained(open_project(options.project, is_writable=False))
        truth = truth_of(options.masks, opened)
        document: dict[str, Any] = {}
        for name in (options.object,) if options.object else truth.objects:
            picks_of = oracle_of(truth, name)
            if options.edit is not None:
                targets = [edit.target for edit in opened.project.document.edits if edit.edit_id == options.edit]
                if not targets or not isinstance(targets[0], Picked):
                    parser.error(f"edit {options.edit} does not act on picked Gaussians")
                picked = targets[0]
                picks_of = lambda edited, views, picked=picked: (picked, {})  # noqa: E731
            found = list(measured(opened, truth, name, picks_of))
            print(
                f"{name}, {'oracle' if options.edit is None else f'edit {options.edit}'}\n{report(found)}", flush=True
            )
            document[name] = [asdict(clip) | {"iou": clip.iou, "roles": weights} for clip, weights in found]
    if options.json:
        options.json.write_text(json_text(document, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
