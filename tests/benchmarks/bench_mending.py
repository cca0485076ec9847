"""Boundaries between clips that are made bad on purpose, mended, with figures before and after.

    python -m tests.benchmarks.bench_mending out/mending

A generated capture (tests.long_captures, 160x120, twelve cameras of which two are held out, three clips of ten frames)
is trained as it is. Its clip 1 is then replaced by one that was trained on a disturbed copy of the capture, so that the
project's own capture says what is right:

    exposure   four of ten training cameras are 12 % brighter in clip 1, which is trained with the usual settings
    colours    they are 5 % brighter, exposure is not measured (color=off), and furniture is marked as free to move
    shift      one training camera is turned by about 6 px in clip 1, and furniture is marked as free to move

Each boundary of clip 1 is mended in a project of its own by `clipgstream mend`. Excess flicker is the seam score of
`eval` on training cameras, 1/255; held-out cameras are told and decide nothing. It fails where less than half of the
excess is gone, or a clip loses more than 0.05 dB on its training cameras.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import shutil
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from app.background.kernels import use_threads
from app.cli.cli import main as clipgstream
from app.evaluation.headless import open_trained
from app.lab.synthetic.scene import SyntheticScene
from app.lab.synthetic.writing import cameras_document, write_json, write_video
from app.project.opening.project_access import open_project
from app.training.worker.build import clip_training
from engine.capture.capture import open_capture
from engine.clip_files.compact import write_compact_clip
from engine.gate.regions import sphere_region
from engine.mending.figures import ENOUGH, MAX_PSNR_LOSS_DB
from engine.training.config import config_of, parse_overrides
from tests.long_captures.changes import Change, make_change
from tests.long_captures.scene import make_long_scene
from tests.long_captures.writing import LOSSLESS, CameraFootage

SETTINGS = ("gaussians_per_anchor=8", "passes=6")
"""On top of the preset toy: about 31 dB on training cameras."""
BAD_CLIP = 1
SHIFT_PX = (5, 3)
"""Right and down, by which what one camera takes is moved."""
FURNITURE = (sphere_region("dynamic", (1.0, 0.75, 0.28), 0.45), sphere_region("dynamic", (-0.35, -0.3, 0.25), 0.4))


@dataclass(frozen=True, slots=True)
class Disturbance:
    """How clip 1 is made bad.

    Attributes:
        log_gain: Of every third training camera, in that clip.
        is_shifted: Whether one of them sees everything moved.
        settings: With which it is trained.
        regions: Marked while it is trained.
    """

    log_gain: float = 0.0
    is_shifted: bool = False
    settings: tuple[str, ...] = ()
    regions: tuple = ()


DISTURBANCES = {
    "exposure": Disturbance(log_gain=0.12),
    "colours": Disturbance(log_gain=0.05, settings=("color=off",), regions=FURNITURE),
    "shift": Disturbance(is_shifted=True, regions=FURNITURE),
}


def write_captures(folder: Path, scene: SyntheticScene) -> None:
    """The capture as it is, and a disturbed copy of each kind; those that are there stay."""
    kinds: dict[str, Disturbance] = {"plain": Disturbance(), **DISTURBANCES}
    missing = {name: kind for name, kind in kinds.items() if not (folder / name / "cameras.json").is_file()}
    trained = [i for i, name in enumerate(scene.rig.names) if name not in scene.default_holdout]
    for camera, name in enumerate(scene.rig.names):
        footage = CameraFootage(scene, camera, supersampling=2) if missing else None
        for kind, disturbance in missing.items():
            assert footage is not None
            (folder / kind).mkdir(parents=True, exist_ok=True)
            pictures = footage.pictures(_brightened(scene, disturbance, camera in trained[1::3], camera))
            if disturbance.is_shifted and camera == trained[4]:
                pictures = (_shifted(p) if _is_bad(scene, frame) else p for frame, p in enumerate(pictures))
            write_video(folder / kind / f"{name}.mp4", pictures, fps=scene.fps, crf=LOSSLESS)
    for kind in missing:  # comes last: without it a folder is not a capture
        write_json(folder / kind / "cameras.json", cameras_document(scene))


def _is_bad(scene: SyntheticScene, frame: int) -> bool:
    return frame // scene.clip_length == BAD_CLIP


def _brightened(scene: SyntheticScene, disturbance: Disturbance, is_chosen: bool, camera: int) -> Change:
    plain = make_change("none", scene)
    gains = plain.camera_gains.copy()
    if is_chosen:
        start = BAD_CLIP * scene.clip_length
        gains[camera, start : start + scene.clip_length] = np.exp(disturbance.log_gain)
    return Change("some cameras are brighter", gains, plain.light)


def _shifted(picture: np.ndarray) -> np.ndarray:
    """As a camera takes it that was knocked: moved, with the border repeated."""
    (right, down), (height, width) = SHIFT_PX, picture.shape[:2]
    wider = np.pad(picture, ((down, 0), (right, 0), (0, 0)), mode="edge")
    return wider[:height, :width]


def train_plain(captures: Path, project: Path) -> None:
    """Train all clips of the capture as it is."""
    arguments = ["--quiet", "--preset", "toy", "--project", str(project)]
    arguments += [part for setting in SETTINGS for part in ("--set", setting)]
    if code := clipgstream(["train", str(captures / "plain"), *arguments]):
        sys.exit(code)


def make_bad(captures: Path, plain: Path, project: Path, kind: str) -> None:
    """A copy of the project whose clip 1 was trained on the disturbed copy of the capture."""
    shutil.rmtree(project, ignore_errors=True)
    shutil.copytree(plain, project, ignore=shutil.ignore_patterns("evaluations", "lock", ".lock"))
    disturbance, opened = DISTURBANCES[kind], open_trained(open_project(project, is_writable=False))
    settings = opened.project.settings
    own = parse_overrides(disturbance.settings)
    config = config_of(settings.config().difference() | own)
    capture = open_capture(captures / kind)
    training = clip_training(
        capture,
        opened.clips[BAD_CLIP],
        config,
        holdout=capture.camera_indices(settings.holdout),
        seed=settings.seed,
        reference=opened.reference,
        prep_dir=opened.project.prep_dir,
        regions=disturbance.regions,
        report=lambda progress: None,
    )
    training.prepare()
    while not training.is_finished:
        training.step()
    write_compact_clip(opened.project.clip_path(BAD_CLIP), training.finish())


def mend(project: Path, after: int) -> dict[str, Any]:
    """What `clipgstream mend --json` says."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        clipgstream(["mend", str(project), "--boundary", f"{after - 1}|{after}", "--json", "--quiet"])
    return json.loads(said.getvalue())


def row_of(kind: str, after: int, found: dict[str, Any]) -> tuple[str, bool]:
    """A row of the table, and whether it is as good as it has to be."""
    before, now = found["before"], found["after"]
    kept = [attempt["method"] for attempt in found["attempts"] if attempt["is_kept"]]
    losses = {index: now["psnr"][index] - before["psnr"][index] for index in before["psnr"]}
    is_good = now["excess"] <= ENOUGH * before["excess"] and min(losses.values()) >= -MAX_PSNR_LOSS_DB
    cells = [
        kind,
        f"{after - 1} and {after}",
        f"{before['excess']:.3f}",
        f"{now['excess']:.3f}",
        f"{100 * (1 - now['excess'] / before['excess']):.0f} %",
        *(f"{index}: {before['psnr'][index]:.2f}, {losses[index]:+.2f}" for index in before["psnr"]),
        f"{before['held_out_excess']:.3f}, {now['held_out_excess']:.3f}",
        ", ".join(kept) or "nothing",
        f"{found['seconds']:.0f}",
    ]
    return f"| {' | '.join(cells)} |", is_good


HEADINGS = (
    "disturbance",
    "clips",
    "excess before, 1/255",
    "after",
    "less",
    "PSNR before and change, dB",
    "likewise",
    "held out: excess before, after",
    "kept",
    "s",
)


def main(argv: Sequence[str] | None = None, say: Callable[[str], None] = print) -> int:
    """Run everything; 1 where a boundary was not mended well enough."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="gets captures and projects")
    parser.add_argument("--only", choices=tuple(DISTURBANCES), help="one kind")
    options = parser.parse_args(argv)
    use_threads(None)
    captures, plain = options.folder / "captures", options.folder / "plain"
    write_captures(captures, make_long_scene(n_cameras=12, n_frames=30, clip_length=10))
    train_plain(captures, plain)
    say(f"| {' | '.join(HEADINGS)} |\n|{'---|' * len(HEADINGS)}")
    is_good = True
    for kind in [options.only] if options.only else DISTURBANCES:
        bad = options.folder / kind
        make_bad(captures, plain, bad, kind)
        for after in (BAD_CLIP, BAD_CLIP + 1):
            project = options.folder / f"{kind}-{after}"
            shutil.rmtree(project, ignore_errors=True)
            shutil.copytree(bad, project)
            row, is_row_good = row_of(kind, after, mend(project, after))
            is_good &= is_row_good
            say(row)
    return 0 if is_good else 1


if __name__ == "__main__":
    sys.exit(main())
