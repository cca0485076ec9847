"""How well are objects followed? IoU of picks with true masks, clip by clip, and what deleting them leaves and takes.

    python -m tests.benchmarks.bench_objects --write out/objects           # captures and masks of all scenes
    python -m tests.benchmarks.bench_objects PROJECT MASKS                  # what the best possible picks reach
    python -m tests.benchmarks.bench_objects PROJECT MASKS --find 5         # selected in frame 5, found by the program
    python -m tests.benchmarks.bench_objects PROJECT MASKS --find 5 --from cam03 --object person_a
    python -m tests.benchmarks.bench_objects PROJECT MASKS --edit 3
    python -m tests.benchmarks.bench_objects PROJECT tests/objects_truth/basketball_boxes.json

Masks are those that `--write` leaves next to each capture, or made from volumes in the held-out cameras. Without
`--find` and `--edit` picks come from the masks themselves (the oracle): no picks of one label per Gaussian and clip do
much better. `--find` selects the object with lassos in one frame, in all evaluated cameras or in that of `--from`.
"Left" is the share of the object that still shows something moving after deletion, "others lost" the share of the other
objects that goes with it. The notes are what the object's pixels are made of, or how sure the program is of a clip.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from app.evaluation.headless import TrainedProject, open_trained
from app.project.opening.project_access import open_project
from engine.editing.clip_rows import named_sets
from engine.editing.edit import ObjectTarget, Picked
from engine.editing.edited_clip import EditedClip
from engine.editing.effects import at_moment
from engine.editing.scene_object import SceneObject
from engine.editing.selection.seen_from import SeenFrom
from engine.objects.finding import SearchedClip, find_object
from engine.storage.json_files import json_text
from tests.benchmarks.options import ending_on_bad_input
from tests.documents.table import table
from tests.objects_truth.measuring import ClipFigures, clip_figures, views_of
from tests.objects_truth.oracle import find_oracle, picked_rows
from tests.objects_truth.scene import SCENARIOS, make_object_scene
from tests.objects_truth.selecting import lasso_seed
from tests.objects_truth.truth import ObjectsTruth, read_truth, write_object_capture
from tests.objects_truth.volumes import read_volumes, truth_in_volumes

PicksOf = Callable[[EditedClip, dict[str, SeenFrom]], tuple[Picked, str]]
"""The picks of a clip, and a note for the table."""


def edited_clips(opened: TrainedProject) -> Iterator[tuple[EditedClip, float]]:
    """The trained clips of a project, and the near plane of each."""
    for clip_index in opened.trained:
        trained = opened.load(clip_index)
        named = named_sets(trained.model, opened.header(clip_index), opened.project.settings.reference_clip)
        yield EditedClip(trained.model, trained.clip, named), trained.base.header.near_plane


def oracle_of(truth: ObjectsTruth, name: str) -> PicksOf:
    """The picks that the masks themselves say."""

    def picks(edited: EditedClip, views: dict[str, SeenFrom]) -> tuple[Picked, str]:
        oracle = find_oracle(edited, views, truth, name)
        roles = ", ".join(f"{role} {weight:.2f}" for role, weight in oracle.weights.items())
        return Picked(picked_rows(edited, oracle.is_object)), roles

    return picks


def found_of(opened: TrainedProject, truth: ObjectsTruth, name: str, frame_index: int, camera: str | None) -> PicksOf:
    """The picks that the program finds from a selection in one frame; see `lasso_seed`."""
    clips = {edited.clip.clip_index: (edited, near) for edited, near in edited_clips(opened)}
    searched = [SearchedClip(edited.clip, lambda edited=edited: edited) for edited, _ in clips.values()]
    edited, near = next(found for found in clips.values() if found[0].clip.start <= frame_index < found[0].clip.stop)
    views = views_of(truth, opened.rig, near=near)
    chosen = views if camera is None else {camera: views[camera]}
    began_s = time.perf_counter()
    seed = lasso_seed(edited, chosen, truth, name, frame_index)
    found = find_object(SceneObject(0, name, seeds=(seed,)), searched)
    print(f"{name}: searched in {time.perf_counter() - began_s:.1f} s", file=sys.stderr)

    def picks(edited: EditedClip, views: dict[str, SeenFrom]) -> tuple[Picked, str]:
        in_clip = next(one for one in found if one.start == edited.clip.start)
        return Picked(in_clip.sets), f"{in_clip.confidence:.2f} {in_clip.doubt}"

    return picks


def edit_of(opened: TrainedProject, edit_id: int) -> PicksOf | None:
    """The picks of an edit of the project; None where there is none, or it acts on something else."""
    document = opened.project.document
    edit = next((edit for edit in document.edits if edit.edit_id == edit_id), None)

    def picks(edited: EditedClip, views: dict[str, SeenFrom]) -> tuple[Picked, str]:
        assert edit is not None
        target = at_moment(edit.target, edited.clip.start, document.objects)
        return (target if isinstance(target, Picked) else Picked(()), "")

    return picks if edit is not None and isinstance(edit.target, Picked | ObjectTarget) else None


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
) -> Iterator[tuple[ClipFigures, str]]:
    """Clip by clip."""
    for edited, near in edited_clips(opened):
        views = views_of(truth, opened.rig, near=near)
        picked, note = picks_of(edited, views)
        yield clip_figures(edited, views, truth, name, picked), note


def mean_iou(figures: list[ClipFigures]) -> float:
    """Over the clips that show the object."""
    return float(np.mean([clip.iou for clip in figures if clip.iou is not None]))


def report(found: list[tuple[ClipFigures, str]]) -> str:
    """The table of an object."""
    rows = [
        (
            str(clip.clip_index), _percent(clip.iou), _percent(clip.lowest), str(clip.n_true),
            str(clip.n_drawn - clip.n_both), _percent(clip.left), _percent(clip.lost),
            note,
        )
        for clip, note in found
    ]  # fmt: skip
    header = ("clip", "IoU %", "worst frame", "true px", "wrong px", "left %", "others lost %", "notes")
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
    parser.add_argument(
        "--find", type=int, metavar="FRAME", help="select it in this frame, and let the program find it"
    )
    parser.add_argument("--from", dest="seen_from", metavar="CAMERA", help="select it as seen from there only")
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
            how, picks_of = "oracle", oracle_of(truth, name)
            if options.find is not None:
                how, picks_of = (
                    f"selected in frame {options.find}",
                    found_of(opened, truth, name, options.find, options.seen_from),
                )
            elif options.edit is not None:
                how, picks_of = f"edit {options.edit}", edit_of(opened, options.edit)
            if picks_of is None:
                parser.error(f"edit {options.edit} does not act on picked Gaussians or an object")
            found = list(measured(opened, truth, name, picks_of))
            print(f"{name}, {how}\n{report(found)}", flush=True)
            document[name] = [asdict(clip) | {"iou": clip.iou, "note": note} for clip, note in found]
    if options.json:
        options.json.write_text(json_text(document, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
