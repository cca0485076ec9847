"""Long captures whose exposures drift or whose light changes: train every clip, and print what it costs in quality.

    python -m tests.benchmarks.bench_long_captures out/long
    python -m tests.benchmarks.bench_long_captures out/long --changes none,drift --frames 60 --set color=off

Captures are generated (tests.long_captures): the same pictures and noise, and one change each. All of it lies in the
folder, and the same command goes on from there. Figures are means over the held-out cameras, which keep their exposure
in every capture; "- none" is the difference to the capture without a change. Still pixels are those that show nothing
that moves, by the truth of the generator, in every fifth frame. Flicker is the change of the render from frame to
frame on still pixels, by the program's own masks, and noise that of the capture itself on the same ones. Seconds say
something only where nothing else runs; beside other work keep to one core (`taskset -c 0`), because threads wait for
each other.

Reference clips that differ by nothing but their seed differ by up to 1 dB (see ±), and with them all clips of the
capture. "Since first" is the mean of the source clips less the reference clip, which leaves that out.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import binary_dilation

from app.cli.cli import main as clipgstream
from app.evaluation.evaluation import evaluate_project
from app.evaluation.headless import TrainedProject, open_trained
from app.export.scene_frames import SceneFrames
from app.export.video.drawing import draw
from app.export.video.views import camera_view
from app.lab.flicker import flicker_figures
from app.lab.synthetic.raycast import make_truth
from app.lab.synthetic.scene import SyntheticScene
from app.lab.synthetic.writing import cameras_document
from app.project.opening.project_access import open_project
from engine.images.psnr import psnr
from engine.metrics.clips.summary import mean_of
from engine.metrics.pictures.colors import to_levels
from engine.storage.json_files import json_text
from tests.benchmarks.options import ending_on_bad_input, names
from tests.documents.table import table
from tests.long_captures.changes import CHANGES, make_change
from tests.long_captures.scene import make_long_scene
from tests.long_captures.writing import write_long_captures

COLUMNS: dict[str, tuple[str, int]] = {
    "psnr": ("PSNR", 2),
    "psnr_spread": ("±", 2),
    "psnr_first": ("first clip", 2),
    "psnr_last": ("last clip", 2),
    "psnr_less": ("less that of nothing", 2),
    "psnr_since": ("later clips against the first, fit", 2),
    "psnr_since_less": ("less that of nothing", 2),
    "psnr_fit": ("fit", 2),
    "psnr_fit_less": ("less that of nothing", 2),
    "psnr_still": ("still pixels", 2),
    "psnr_still_less": ("less that of nothing", 2),
    "flicker_inside": ("flicker", 3),
    "flicker_borders": ("borders", 3),
    "noise": ("noise", 3),
    "seconds_early": ("s early", 1),
    "seconds_late": ("s late", 1),
    "memory_mb_early": ("MB early", 0),
    "memory_mb_late": ("MB late", 0),
    "memory_growth": ("growth %", 1),
    "kilobytes": ("kB/clip", 0),
}
"""Figure to its heading and decimals. PSNR in dB, ± its standard deviation over seeds, flicker and noise in 1/255.
Seconds: median of the first ten source clips and of the last ten. Memory: most of the training process of the second
clip, and of the last."""
WORDS = {
    "none": "nothing",
    "drift": "exposure drifts by up to 10 %",
    "step": "exposure steps by 8 % in a third of the cameras",
    "shadow": "a shadow crosses the floor",
    "lamp": "a lamp dims by 20 %",
    "daylight": "daylight turns warmer by 8 %",
}
"""What changes in a capture, for a table."""
SETTINGS = ("gaussians_per_anchor=8", "passes=6")
"""On top of the preset: about 28 dB, and a source clip takes 10 s on one quiet core."""
BY_PROGRAM = ("psnr", "psnr_fit")
COMPARED = (*BY_PROGRAM, "psnr_since", "psnr_still")
STILL_EVERY = 5
"""Frames from one in which still pixels are compared to the next."""
NEAR_MOTION_PX = 2
"""Pixels this near to what moves are not still: half of them may be covered by it."""
MOST_CLIPS = 10
"""Source clips at either end of which the median time is taken."""


def write_missing(folder: Path, scene: SyntheticScene, chosen: Sequence[str]) -> None:
    """Write those captures that are not there complete."""
    wanted = json.loads(json_text(cameras_document(scene)))
    missing = {}
    for name in chosen:
        path = folder / name / "cameras.json"
        if not path.is_file() or json.loads(path.read_text()) != wanted:
            path.unlink(missing_ok=True)
            missing[name] = make_change(name, scene)
    if missing:
        print(f"writing {', '.join(missing)}", file=sys.stderr)
        write_long_captures(folder, scene, missing, report=lambda line: print(line, file=sys.stderr))


def train(capture: Path, project: Path, seed: int, options: argparse.Namespace) -> None:
    """Train the chosen clips that are not trained yet; a failure ends the program."""
    arguments = ["--quiet", "--clip-length", str(options.clip_length), "--preset", options.preset, "--seed", str(seed)]
    arguments += [part for setting in (*SETTINGS, *options.set) for part in ("--set", setting)]
    for i in chosen_clips(options):
        which = ["--project", str(project), "--clips", f"{i}:{i + 1}"]
        if code := clipgstream(["train", str(capture), *which, *arguments]):
            sys.exit(code)


def chosen_clips(options: argparse.Namespace) -> range:
    """Clips to train and to measure; the first is always among them."""
    return range(0, options.clips, options.every)


def measure(project: Path, scene: SyntheticScene, clip_indices: Sequence[int]) -> dict[str, Any]:
    """Figures of a trained capture; see COLUMNS. Also the PSNR of every clip, as a list."""
    opened = open_trained(open_project(project, is_writable=False))
    document = evaluate_project(
        opened,
        clip_indices=clip_indices,
        cameras=opened.capture.camera_indices(opened.project.settings.holdout),
        metrics="quick",
        on_progress=lambda n_done, n_rows, row: None,
    )
    clips = [document["means"]["clips"][str(i)]["held_out"] for i in clip_indices]
    levels, fitted = ([clip[name] for clip in clips] for name in BY_PROGRAM)
    pairs = document["seams"]["rows"]
    noise = mean_of([pair["truth_change_static"] for pair in pairs])
    flicker = flicker_figures(pairs)
    return {
        **{name: document["means"]["held_out"][name] for name in BY_PROGRAM},
        "psnr_still": still_psnr(opened, scene, clip_indices),
        "psnr_first": levels[0],
        "psnr_since": statistics.mean(fitted[1:]) - fitted[0] if fitted[1:] else None,
        "psnr_last": levels[-1],
        "flicker_inside": flicker["flicker_inside"],
        "flicker_borders": flicker["flicker_borders"],
        "noise": None if noise is None else 255.0 * noise,
        **costs(opened, clip_indices),
        "by_clip": {name: [clip[name] for clip in clips] for name in BY_PROGRAM},
    }


def still_psnr(opened: TrainedProject, scene: SyntheticScene, clip_indices: Sequence[int]) -> float | None:
    """PSNR of pixels that show nothing that moves, mean over held-out cameras and frames, dB."""
    frames = [frame for i in clip_indices for frame in opened.clips[i].frame_indices()][::STILL_EVERY]
    found: list[float | None] = []
    made = SceneFrames(opened)
    for camera in opened.capture.camera_indices(opened.project.settings.holdout):
        view = camera_view(opened.capture.rig, camera, None)(0, 0.0)
        for frame in frames:
            truth = opened.capture.frame(camera, frame) / 255.0
            found.append(psnr(to_levels(draw(made, frame, view).color) / 255.0, truth, is_still(scene, camera, frame)))
    return mean_of(found)


def is_still(scene: SyntheticScene, camera_index: int, frame_index: int) -> np.ndarray:
    """Pixels that are not near anything that moves. [H, W] bool"""
    is_moving = make_truth(scene, camera_index, frame_index).is_moving
    return np.logical_not(binary_dilation(is_moving, iterations=NEAR_MOTION_PX))


def costs(opened: TrainedProject, clip_indices: Sequence[int]) -> dict[str, Any]:
    """Seconds, memory and bytes of the source clips, early ones against late ones; None where there are none."""
    headers = [opened.header(i) for i in clip_indices[1:]]
    sizes = [opened.project.clip_path(i).stat().st_size for i in clip_indices[1:]]
    seconds = [header.figures.seconds for header in headers if header.figures.seconds is not None]
    memory = [header.figures.memory_mb for header in headers if header.figures.memory_mb is not None]
    n = min(MOST_CLIPS, len(seconds) // 2)
    return {
        "seconds_early": statistics.median(seconds[:n]) if n else None,
        "seconds_late": statistics.median(seconds[-n:]) if n else None,
        "memory_mb_early": memory[0] if memory else None,
        "memory_mb_late": memory[-1] if memory else None,
        "memory_growth": 100 * (memory[-1] / memory[0] - 1) if memory else None,
        "kilobytes": statistics.mean(sizes) / 1e3 if sizes else None,
        "seconds_by_clip": seconds,
        "memory_mb_by_clip": memory,
    }


def over_seeds(results: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Means over the trainings of one capture with several seeds, and all that was measured of each of them."""
    known = [name for name in COLUMNS if name in results[0]]
    levels = [result["psnr"] for result in results]
    spread = statistics.stdev(levels) if len(levels) > 1 else None
    return {name: mean_of([result[name] for result in results]) for name in known} | {
        "psnr_spread": spread,
        "by_seed": list(results),
    }


def compared(rows: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """The same rows with their differences to "none"; None where it was not measured."""
    base = rows.get("none")

    def less(row: dict[str, Any], figure: str) -> float | None:
        return None if base is None or row[figure] is None else row[figure] - base[figure]

    return {name: row | {f"{figure}_less": less(row, figure) for figure in COMPARED} for name, row in rows.items()}


def table_text(rows: dict[str, dict[str, Any]]) -> str:
    """One line per capture, as Markdown."""
    lines = []
    for name, row in rows.items():
        cells = ["-" if row[key] is None else f"{row[key]:.{digits}f}" for key, (_, digits) in COLUMNS.items()]
        lines.append([WORDS[name], *cells])
    return table(["what changes", *(heading for heading, _ in COLUMNS.values())], lines)


def main() -> None:
    """Command line; see the module docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="folder of captures and projects; what lies there is taken up")
    parser.add_argument("--changes", default=",".join(CHANGES), help="names, separated by commas")
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--clips", type=int, help="how many clips, from the first; all by default")
    parser.add_argument("--every", type=int, default=1, help="only every n-th clip")
    parser.add_argument("--clip-length", type=int, default=10)
    parser.add_argument("--cameras", type=int, default=12)
    parser.add_argument("--width", type=int, default=160, help="of the pictures, which are 4:3")
    parser.add_argument("--preset", default="toy")
    parser.add_argument("--set", nargs="*", default=[], help="key=value settings, beside those here")
    parser.add_argument("--seeds", type=int, default=1, help="trainings of each capture; figures are their means")
    parser.add_argument("--projects", default="projects", help="name of a folder for other settings or another version")
    parser.add_argument("--json", type=Path, help="also write all figures here")
    options = parser.parse_args()
    chosen = names(options.changes, list(CHANGES), parser)
    n_clips = -(-options.frames // options.clip_length)
    options.clips = n_clips if options.clips is None else min(options.clips, n_clips)
    scene = make_long_scene(
        size=(options.width, options.width * 3 // 4),
        n_cameras=options.cameras,
        n_frames=options.frames,
        clip_length=options.clip_length,
    )
    write_missing(options.out / "captures", scene, chosen)
    rows: dict[str, dict[str, Any]] = {}
    for name in chosen:
        results = []
        for seed in range(options.seeds):
            print(f"training {name}, seed {seed}", file=sys.stderr)
            project = options.out / options.projects / f"{name}-seed{seed}"
            train(options.out / "captures" / name, project, seed, options)
            with ending_on_bad_input():
                results.append(measure(project, scene, chosen_clips(options)))
        rows[name] = over_seeds(results)
        load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
        size = f"{len(chosen_clips(options))} of {n_clips} clips of {options.clip_length} frames"
        print(f"\n{size}, preset {options.preset}, {options.seeds} seeds{load}")
        print(table_text(compared(rows)), flush=True)
    if options.json:
        options.json.write_text(json_text(compared(rows), indent=1) + "\n")


if __name__ == "__main__":
    main()
