"""How well are objects followed? IoU of picks with true masks, clip by clip, and what deleting them leaves and takes.

    python -m tests.benchmarks.bench_objects --write out/objects           # captures and masks of all scenes
    python -m tests.benchmarks.bench_objects PROJECT MASKS                  # what the best possible picks reach
    python -m tests.benchmarks.bench_objects PROJECT MASKS --find 5         # selected in frame 5, found by the program
    python -m tests.benchmarks.bench_objects PROJECT MASKS --find 5 --from cam03 --object person_a
    python -m tests.benchmarks.bench_objects PROJECT MASKS --find 5 --from cam03 --corrections 2
    python -m tests.benchmarks.bench_objects PROJECT MASKS --edit 3
    python -m tests.benchmarks.bench_objects PROJECT tests/objects_truth/basketball_boxes.json
    python -m tests.benchmarks.bench_objects --all out/objects           # writes, trains, finds all generated ones

Masks are those that `--write` leaves next to each capture, or made from volumes in the held-out cameras. Without
`--find` and `--edit` picks come from the masks themselves (the oracle): no picks of one label per Gaussian and clip do
much better. `--find` selects what is visible in lassos in one frame, in all evaluated cameras or in that of `--from`;
each of `--corrections` then adds what is missing, or removes what is too much, with one lasso in the worst clip.
"Left" is the share of the object that still shows something moving after deletion, "others lost" the share of the other
objects that goes with it. The notes are what the object's pixels are made of, or how sure the program is of a clip.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from app.cli.cli import main as clipgstream
from app.evaluation.headless import TrainedProject, open_trained
from app.project.opening.project_access import open_project
from engine.editing.edit import ObjectTarget, Picked
from engine.editing.edited_clip import EditedClip
from engine.editing.effects import at_moment
from engine.editing.selection.seen_from import SeenFrom
from engine.storage.json_files import json_text
from tests.benchmarks.objects_summary import Found, PicksOf, Row, edited_clip, measured, searches, summary
from tests.benchmarks.options import ending_on_bad_input
from tests.documents.table import table
from tests.objects_truth.measuring import ClipFigures
from tests.objects_truth.oracle import find_oracle, picked_rows
from tests.objects_truth.scene import SCENARIOS, make_object_scene
from tests.objects_truth.truth import ObjectsTruth, read_truth, write_object_capture
from tests.objects_truth.volumes import read_volumes, truth_in_volumes

FRAME, CAMERA, N_CORRECTIONS = 4, "cam03", 2
"""Where objects of generated captures are selected, and how often they are corrected."""

TRAINING = {"long": ("--preset", "toy", "--set", "gaussians_per_anchor=8", "--set", "passes=6")}
"""Options of the training, by scenario; none by default."""
EVERY = {"long": 2}
"""Of that many frames one is measured, by scenario; of the others, all."""


def oracle_of(truth: ObjectsTruth, name: str) -> PicksOf:
    """The picks that the masks themselves say."""

    def picks(edited: EditedClip, views: dict[str, SeenFrom]) -> tuple[Picked, str]:
        oracle = find_oracle(edited, views, truth, name)
        roles = ", ".join(f"{role} {weight:.2f}" for role, weight in oracle.weights.items())
        return Picked(picked_rows(edited, oracle.is_object)), roles

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
    views, clips = {}, [edited_clip(opened, i) for i in opened.trained]
    for camera in opened.project.settings.holdout:
        i = opened.rig.names.index(camera)
        width, height = (int(side) for side in opened.rig.image_sizes[i])
        views[camera] = SeenFrom(opened.rig.world_to_camera[i], opened.rig.Ks[i], width, height, clips[0][1])
    return truth_in_volumes((clip for clip, _ in clips), views, read_volumes(path))


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


def found_and_said(
    opened: TrainedProject,
    truth: ObjectsTruth,
    name: str,
    frame_index: int,
    *,
    seen_from: str | None,
    n_corrections: int,
    every: int = 1,
) -> Iterator[Found]:
    """As `searches`, and prints a table of each."""
    for found in searches(
        opened, truth, name, frame_index=frame_index, seen_from=seen_from, n_corrections=n_corrections, every=every
    ):
        how = f"selected in frame {frame_index}, {found.n_corrections} corrections, searched in {found.search_s:.1f} s"
        print(f"{name}, {how}\n{report(found.clips)}", flush=True)
        yield found


def write_scenario(folder: Path, scenario: str) -> Path:
    """Write a generated capture and its masks; returns its folder."""
    write_object_capture(folder / scenario, folder / f"{scenario}-masks", make_object_scene(scenario))
    return folder / scenario


def found_in_scenario(folder: Path, scenario: str) -> Iterator[Row]:
    """Find the objects of a generated capture, which is written and trained first where that has not been done.

    Raises:
        SystemExit: The training failed.
    """
    capture, project = folder / scenario, folder / f"{scenario}-project"
    if not (capture / "cameras.json").is_file():
        write_scenario(folder, scenario)
    with contextlib.redirect_stdout(sys.stderr):
        code = clipgstream(["train", str(capture), "--project", str(project), *TRAINING.get(scenario, ())])
    if code:
        sys.exit(code)
    opened, truth = open_trained(open_project(project, is_writable=False)), read_truth(folder / f"{scenario}-masks")
    for name in truth.objects:
        found = found_and_said(
            opened, truth, name, FRAME, seen_from=CAMERA, n_corrections=N_CORRECTIONS, every=EVERY.get(scenario, 1)
        )
        yield scenario, name, list(found)


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
    parser.add_argument("--title", help="of the capture, for the last table")
    parser.add_argument("--corrections", type=int, default=0, metavar="N", help="correct it so many times")
    parser.add_argument(
        "--all", type=Path, metavar="FOLDER", help="generated scenes, whatever of them is missing there"
    )
    options = parser.parse_args(argv)
    if options.write:
        for scenario in SCENARIOS:
            print(write_scenario(options.write, scenario))
        return
    if options.all:
        print(summary([row for scenario in SCENARIOS for row in found_in_scenario(options.all, scenario)]))
        return
    if options.project is None or options.masks is None:
        parser.error("name a project and its masks, or --write FOLDER, or --all FOLDER")
    with ending_on_bad_input():
        opened = open_trained(open_project(options.project, is_writable=False))
        truth = truth_of(options.masks, opened)
        document: dict[str, Any] = {}
        rows: list[Row] = []
        for name in (options.object,) if options.object else truth.objects:
            if options.find is not None:
                found = list(
                    found_and_said(
                        opened,
                        truth,
                        name,
                        options.find,
                        seen_from=options.seen_from,
                        n_corrections=options.corrections,
                    )
                )
                rows.append((options.title or opened.project.folder.name, name, found))
                document[name] = [_written(one.clips) for one in found]
                continue
            how, picks_of = "oracle", oracle_of(truth, name)
            if options.edit is not None:
                how, picks_of = f"edit {options.edit}", edit_of(opened, options.edit)
            if picks_of is None:
                parser.error(f"edit {options.edit} does not act on picked Gaussians or an object")
            clips = list(measured(opened, truth, name, picks_of))
            print(f"{name}, {how}\n{report(clips)}", flush=True)
            document[name] = _written(clips)
    if rows:
        print(summary(rows))
    if options.json:
        options.json.write_text(json_text(document, indent=1) + "\n", encoding="utf-8")


def _written(clips: list[tuple[ClipFigures, str]]) -> list[dict[str, Any]]:
    return [asdict(clip) | {"iou": clip.iou, "note": note} for clip, note in clips]


if __name__ == "__main__":
    main()
