"""How much longer does a cluster of three nodes take when it loses one of them halfway through?

    python -m tests.benchmarks.bench_node_loss [--clips 10] [--steps 300]

Ray runs on this computer, with three nodes of one core. Clips take their time asleep, so that three nodes are three
times as fast as one, however many cores there are. All else is as in a real training: processes, claims, checkpoints,
files. Trained once undisturbed and once with a node that dies while it trains a clip. All clips have to be the same.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections import Counter
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

from app.project.opening.opened_project import opened_project
from app.project.opening.project_access import create_project, default_settings
from engine.capture.capture import open_capture
from engine.clip_files.clip_state import read_clip_state
from tests.app.cluster.clusters import STEP_S, Driver, driving, ray_nodes
from tests.app.fakes import write_capture
from tests.documents.table import table

N_NODES = 3


def train(made: Any, folder: Path, capture_folder: Path, options: argparse.Namespace, *, lose_after_s: float) -> float:
    """Train all clips of a new project, and after that time remove a node that trains one. Returns seconds."""
    capture = open_capture(capture_folder)
    settings = replace(default_settings(capture, clip_length=1), overrides={"joint_steps": options.steps})
    with closing(create_project(folder, settings)) as project:
        opened = opened_project(capture, project, 1)
        with driving(opened, made.address) as driver:
            started_s = time.perf_counter()
            driver.service.enqueue_all(range(options.clips))
            driver.poll_until(lambda: time.perf_counter() - started_s > lose_after_s or not driver.service.is_busy)
            if driver.service.is_busy:
                driver.poll_until(lambda: bool(_busy(made, driver)))
                made.remove_node(_busy(made, driver)[0], allow_graceful=False)
            driver.run_out()
            took_s = time.perf_counter() - started_s
            assert Counter(driver.trained) == Counter(range(options.clips)), "each clip once"
    return took_s


def _busy(made: Any, driver: Driver) -> list[Any]:
    """Nodes that have taken some steps of a clip."""
    runs = driver.service.runs
    return [n for n in made.worker_nodes if any(runs[clip].step > 1 for clip in driver.on_node(n.node_id))]


def prints_of(folder: Path, n_clips: int) -> list[str]:
    """Fingerprints of all clips."""
    return [read_clip_state(folder / "clips" / f"{clip:04d}.safetensors").fingerprint for clip in range(n_clips)]


def main() -> None:
    """Command line; see the module docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clips", type=int, default=10, help="the reference clip included")
    parser.add_argument("--steps", type=int, default=300, help=f"of a clip, {STEP_S} s each")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="node-loss-") as name:
        work = Path(name)
        capture = write_capture(work / "ring", n_frames=options.clips)
        with ray_nodes(N_NODES, work / "caches") as made:
            whole_s = train(made, work / "whole", capture, options, lose_after_s=float("inf"))
        with ray_nodes(N_NODES, work / "other caches") as made:
            lossy_s = train(made, work / "lossy", capture, options, lose_after_s=whole_s / 2)
        same = prints_of(work / "whole", options.clips) == prints_of(work / "lossy", options.clips)
    rows = [["undisturbed", f"{whole_s:.1f}", "1.00"]]
    rows.append(["a node is lost halfway through", f"{lossy_s:.1f}", f"{lossy_s / whole_s:.2f}"])
    print(table([f"{options.clips} clips, {N_NODES} nodes", "s", "times"], rows))
    print(f"clips are {'the same' if same else 'NOT THE SAME'}, bit for bit")


if __name__ == "__main__":
    main()
