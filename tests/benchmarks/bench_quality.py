"""Quality against time: train the first clips of a capture and print the table of held-out figures.

    python -m tests.benchmarks.bench_quality assets/sample
    python -m tests.benchmarks.bench_quality PATH/panoptic_basketball --holdout 0,10,15,30 --pictures out/

Held-out cameras are only looked at after a clip is finished. Seconds are wall clock on this machine, kernels compiled
beforehand; preparation (clouds, masks) and training are told apart. `--pictures` writes truth, render and error side
by side for every held-out camera at the middle of each clip.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import tempfile
import time
from pathlib import Path

import numpy as np
import torch
from PIL import Image

from app.lab.synthetic.raycast import make_truth
from app.lab.synthetic.scene import make_scene
from engine.backends.table import backend_called
from engine.capture.capture import Capture, open_capture
from engine.capture.clip import Clip, split_clips
from engine.clip_files.clip_state import ClipState
from engine.images.psnr import psnr
from engine.kernels.threads import configure_threads
from engine.metrics.clips.evaluate import Evaluation
from engine.metrics.clips.summary import means
from engine.metrics.clips.trained_clip import TrainedClip
from engine.model.clip_view import REACH_SPACINGS, View, render_model
from engine.model.reading import load_clip_model
from engine.progress import Progress
from engine.training.clip_training import ClipTraining
from engine.training.config import TrainConfig, config_of, parse_overrides
from engine.training.variants.variant_method import method_of
from tests.benchmarks.options import ending_on_bad_input

COLUMNS = (
    "psnr",
    "psnr_fit",
    "psnr_moving",
    "psnr_rest",
    "psnr_fit_moving",
    "ssim",
    "ssim_fit",
    "moving_share",
    "psnr_new_object",
)


def train(
    capture: Capture, clip: Clip, config: TrainConfig, holdout: list[int], reference: ClipState | None, prep_dir: Path
) -> tuple[ClipState, dict]:
    """Train one clip; returns its state and the seconds spent."""
    started = time.perf_counter()
    said: list[str] = []
    stage_starts: list[tuple[float, str]] = []

    def report(progress: Progress) -> None:
        if not stage_starts or stage_starts[-1][1] != progress.stage:
            stage_starts.append((time.perf_counter(), progress.stage))
        if progress.message and progress.message not in said:
            said.append(progress.message)
            print(f"  {time.perf_counter() - started:6.1f} s  {progress.stage}: {progress.message}", flush=True)

    training = ClipTraining(
        capture,
        clip,
        config=config,
        method=method_of(config, previous=None),
        holdout=holdout,
        reference=reference,
        seed=0,
        prep_dir=prep_dir,
        report=report,
        backend=backend_called("cpu"),
    )
    training.prepare()
    preparation_s = time.perf_counter() - started
    durations_ms: dict[str, list[float]] = {}
    losses = []
    while not training.is_finished:
        begun = time.perf_counter()
        before = len(stage_starts)
        stats = training.step()
        elapsed = time.perf_counter() - begun
        if len(stage_starts) > before:  # this step prepared the next phase
            preparation_s += elapsed
        else:
            durations_ms.setdefault(stats.stage, []).append(1e3 * elapsed)
        losses.append(stats.loss)
        if stats.step % 300 == 0:
            line = f"step {stats.step}/{stats.n_steps} {stats.stage} loss {np.mean(losses[-100:]):.4f}"
            print(f"  {time.perf_counter() - started:6.1f} s  {line} {stats.n_gaussians} Gaussians", flush=True)
    total_s = time.perf_counter() - started
    timing = {
        "preparation_s": preparation_s,
        "training_s": total_s - preparation_s,
        "median_step_ms": {stage: float(np.median(values)) for stage, values in durations_ms.items()},
        "steps": training.n_steps,
    }
    return training.finish().state, timing  # as stored: what is measured and what the next clip is trained on


def write_pictures(
    folder: Path, capture: Capture, clip: Clip, state: ClipState, reference: ClipState, cameras: list[int]
) -> None:
    """Truth, render and four times the error, one row per camera."""
    model = load_clip_model(state, reference, backend=backend_called("cpu"))
    frame = clip.start + clip.n_frames // 2
    reach = REACH_SPACINGS * reference.header.spacing
    rows = []
    for camera in cameras:
        view = _view(capture, camera, reference)
        truth = capture.frame(camera, frame) / 255.0
        image = render_model(model, view, clip.clip_time(frame), reach=reach).numpy().clip(0, 1)
        rows.append(np.concatenate([truth, image, np.clip(4 * np.abs(image - truth), 0, 1)], axis=1))
    folder.mkdir(parents=True, exist_ok=True)
    sheet = (np.concatenate(rows) * 255).astype(np.uint8)
    Image.fromarray(sheet).save(folder / f"clip{clip.clip_index}.png")


def new_object_psnr(
    capture: Capture, clip: Clip, state: ClipState, reference: ClipState, cameras: list[int]
) -> float | None:
    """PSNR inside the true mask of the sample's "gift", which first appears in clip 1; None for other captures.

    Mean over all frames of the clip and the given cameras, raw colours, dB.
    """
    scene = make_scene()
    is_sample = capture.rig.names == scene.rig.names and np.allclose(capture.rig.Ks, scene.rig.Ks)
    if not is_sample or clip.clip_index == 0:
        return None
    model = load_clip_model(state, reference, backend=backend_called("cpu"))
    values = []
    for camera in cameras:
        view = _view(capture, camera, reference)
        for frame in clip.frame_indices():
            mask = make_truth(scene, camera, frame).mask("gift")
            if mask.sum() < 50:  # hidden from this camera
                continue
            image = render_model(model, view, clip.clip_time(frame), reach=REACH_SPACINGS * reference.header.spacing)
            values.append(psnr(image.numpy(), capture.frame(camera, frame) / 255.0, mask))
    return float(np.mean(values)) if values else None


def _view(capture: Capture, camera: int, reference: ClipState) -> View:
    width, height = (int(v) for v in capture.rig.image_sizes[camera])
    matrices = (capture.rig.world_to_camera[camera], capture.rig.Ks[camera])
    return View.from_arrays(*matrices, width=width, height=height, near_plane=reference.header.near_plane)


def main() -> None:
    """Command line; see the module docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", type=Path)
    parser.add_argument("--holdout", default="", help="camera names, comma separated; the capture's own by default")
    parser.add_argument("--clips", type=int, default=2, help="how many clips, from the first")
    parser.add_argument("--clip-length", type=int, default=10)
    parser.add_argument("--scale", type=float, default=1.0)
    parser.add_argument("--set", nargs="*", default=[], help="key=value settings")
    parser.add_argument("--frames-every", type=int, default=1, help="evaluate every n-th frame of a clip")
    parser.add_argument("--pictures", type=Path)
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    configure_threads()
    with ending_on_bad_input():
        capture = open_capture(args.capture, scale=args.scale)
        names = args.holdout.split(",") if args.holdout else list(capture.default_holdout)
        holdout = capture.camera_indices(names)
        config = config_of(parse_overrides(args.set))
    clips = split_clips(capture.n_frames, args.clip_length)[: args.clips]
    versions = f"torch {torch.__version__}, Python {platform.python_version()}, {torch.get_num_threads()} threads"
    versions += f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    print(f"{capture.path.name}: {len(capture.rig)} cameras, held out {', '.join(names)}; {versions}")
    reference: ClipState | None = None
    table = []
    with tempfile.TemporaryDirectory() as prep_dir:
        for clip in clips:
            print(f"clip {clip.clip_index}")
            state, timing = train(capture, clip, config, holdout, reference, Path(prep_dir))
            reference = reference or state
            frames = list(clip.frame_indices())[:: args.frames_every]
            trained = TrainedClip(clip, load_clip_model(state, reference, backend=backend_called("cpu")), reference)
            rows = Evaluation(capture, cameras=holdout, holdout=holdout).measure(trained, frames=frames)
            figures = means(rows)
            by_camera = {n: means([row for row in rows if row.camera == n])["psnr"] for n in names}
            size_mb = sum(array.nbytes for array in state.arrays.values()) / 1e6
            new_object = new_object_psnr(capture, clip, state, reference, holdout)
            row = {"clip": clip.clip_index, **timing, **figures, "psnr_new_object": new_object}
            table.append(row | {"by_camera": by_camera, "size_mb": size_mb})
            if args.pictures:
                write_pictures(args.pictures, capture, clip, state, reference, holdout)
    print("clip  prep s  train s  steps  " + "  ".join(f"{c:>15}" for c in COLUMNS) + "  MB")
    for row in table:
        cells = "  ".join("              -" if row[c] is None else f"{row[c]:15.3f}" for c in COLUMNS)
        seconds = f"{row['preparation_s']:6.1f}  {row['training_s']:7.1f}  {row['steps']:5d}"
        print(f"{row['clip']:4d}  {seconds}  {cells}  {row['size_mb']:.1f}")
    for row in table:
        steps = {k: round(v, 1) for k, v in row["median_step_ms"].items()}
        cameras = {k: round(v, 2) for k, v in row["by_camera"].items()}
        print(f"clip {row['clip']}: ms per step {steps}; PSNR by held-out camera {cameras}")
    if args.json:
        args.json.write_text(json.dumps(table, indent=1))


if __name__ == "__main__":
    main()
