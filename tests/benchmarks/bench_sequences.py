"""Files over time of a trained project: their size, how near they come to the live picture, and how fast one seeks.

    python -m tests.benchmarks.bench_sequences PROJECT
    python -m tests.benchmarks.bench_sequences PROJECT --formats 4dgs --frames 150

Frames are those of all trained clips; where more are asked for than there are, the clips are played again from the
start, and what moves is written again. Seconds of seeking are wall-clock and of the processor, for frames in random
order of a file that was read before, each from a chunk that is not decoded yet, with the reader of the export.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from contextlib import closing
from pathlib import Path

import numpy as np

from app.evaluation.headless import open_trained
from app.export.gaussians.read_back import ReadBack
from app.export.scene_frames import SceneFrames
from app.export.sequences.scene_stretches import SceneStretches
from app.export.take import TakeFrame
from app.project.opening.project_access import open_project
from engine.export.sequences.sequence import SequenceTiming
from engine.export.sequences.table import SEQUENCES
from engine.export.world import FileWorld
from engine.storage.json_files import json_text
from engine.timing.timing import SourceMoment
from tests.documents.table import table

N_SEEKS, N_CHECKED = 15, 5


def measured(scene: SceneFrames, name: str, n_frames: int, path: Path) -> dict[str, float]:
    """Write a file of so many frames and measure it."""
    kind, known, world = SEQUENCES[name], scene.trained_frames, FileWorld()
    frames = [TakeFrame(number, (SourceMoment(known[number % len(known)]),)) for number in range(n_frames)]
    started_s = time.perf_counter()
    stretches = SceneStretches(scene, frames, world, lambda n_done: None)
    kind.write(stretches, SequenceTiming(n_frames, scene.opened.capture.fps), path)
    written_s = time.perf_counter() - started_s
    assert kind.problems(path) == ()
    check, figures = ReadBack(scene, world), []
    with closing(kind.open(path)) as reader:
        for number in np.linspace(0, n_frames - 1, N_CHECKED).round().astype(int).tolist():
            live = scene.at_moments(frames[number].moments)
            figures += check.psnr_db(reader.splats(number), frames[number].frame, live).values()
    seconds, cpu_s = [], []
    for number in np.random.default_rng(0).integers(0, n_frames, N_SEEKS).tolist():
        with closing(kind.open(path)) as reader:
            reader.splats((number + n_frames // 2) % n_frames)  # what stands still is there
            started_s, started_cpu_s = time.perf_counter(), time.process_time()
            reader.splats(number)
            seconds.append(time.perf_counter() - started_s)
            cpu_s.append(time.process_time() - started_cpu_s)
    return {
        "frames": n_frames,
        "MB": path.stat().st_size / 1e6,
        "kB per frame": path.stat().st_size / 1e3 / n_frames,
        "PSNR, worst": min(figures),
        "PSNR, mean": statistics.mean(figures),
        "seek, ms": 1e3 * statistics.median(seconds),
        "longest, ms": 1e3 * max(seconds),
        "seek, ms of the processor": 1e3 * statistics.median(cpu_s),
        "written, s": written_s,
    }


def main(argv: list[str] | None = None) -> None:
    """Print the table; see the module docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("project", type=Path)
    parser.add_argument("--formats", default=",".join(name for name in SEQUENCES if name != "usda"))
    parser.add_argument("--frames", default="", help="numbers of frames, with commas; by default those there are")
    parser.add_argument("--json", type=Path, help="also write all figures here")
    options = parser.parse_args(argv)
    scene = SceneFrames(open_trained(open_project(options.project, is_writable=False)))
    counts = [int(n) for n in options.frames.split(",") if n] or [len(scene.trained_frames)]
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in options.formats.split(","):
            for n_frames in counts:
                path = Path(folder) / f"scene{SEQUENCES[name].suffix}"
                found[f"{name}, {n_frames}"] = measured(scene, name, n_frames, path)
    names = list(next(iter(found.values())))
    rows = [(key.split(",")[0], *(_text(name, values[name]) for name in names)) for key, values in found.items()]
    print(table(("format", *names), rows))
    if options.json:
        options.json.write_text(json_text(found, indent=1) + "\n", encoding="utf-8")


def _text(name: str, value: float) -> str:
    n_digits = 1 if name == "MB" or name.startswith("PSNR") else 0
    return f"{value:,.{n_digits}f}"


if __name__ == "__main__":
    main()
