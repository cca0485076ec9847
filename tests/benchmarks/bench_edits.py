"""What edits cost: making a frame of a trained project with none, one and twenty of them, and what they take in memory.

    python -m tests.benchmarks.bench_edits PROJECT
    python -m tests.benchmarks.bench_edits PROJECT --clip 1 --runs 40 --json edits.json

Frames of one clip are made in turn. "First" is the first frame after the stack has changed, as during a drag.
"""

from __future__ import annotations

import argparse
import statistics
import time
from pathlib import Path
from typing import Any

import numpy as np

from app.evaluation.headless import open_trained
from app.project.opening.project_access import open_project
from engine.editing.actions import Delete, Expose, Hold, Recolor, Smooth, Transform
from engine.editing.clip_rows import named_sets
from engine.editing.edit import Box, Edit, Everything, Picked, PickedRows, Sphere
from engine.editing.edited_clip import EditedClip
from engine.editing.effects import NO_EFFECTS, Effects
from engine.editing.picks import pack_rows
from engine.storage.json_files import json_text


def stacks(clip: EditedClip) -> dict[str, tuple[Edit, ...]]:
    """Stacks by name, which act on a good part of the scene each."""
    found = clip.decode(0.0)
    means = found.gaussians.means.numpy()
    middle = tuple(float(value) for value in np.median(means, axis=0))
    radius = float(np.median(np.linalg.norm(means - middle, axis=1)))
    places = [place for place in range(len(found.rows.sets)) if (found.rows.set_index == place).any()]
    picked = Picked(
        tuple(
            PickedRows(
                one.clip_index, one.origin, one.role, pack_rows(found.rows.number[found.rows.set_index == place][::3])
            )
            for place in places
            for one in (found.rows.sets[place],)
        )
    )
    targets = (Sphere(middle, radius), Box(middle, (radius, radius, radius)), picked)  # type: ignore[arg-type]
    actions = (Recolor(tint_share=0.2), Expose(0.5), Transform((0.01, 0.0, 0.0)), Delete())
    twenty = tuple(Edit(i, "", targets[i % 3], actions[i % 4] if i > 15 else actions[i % 3]) for i in range(20))
    return {
        "none": (),
        "1 deletes a sphere": (Edit(0, "", targets[0], Delete()),),
        "20 mixed": twenty,
        "1 holds": (Edit(0, "", Everything(), Hold(clip.clip.start)),),
        "1 smooths, sigma 2": (Edit(0, "", Everything(), Smooth(2.0)),),
    }


def measured(clip: EditedClip, effects: Effects, n_runs: int) -> float:
    """Median of making a frame, ms."""
    n_frames, times = clip.clip.n_frames, []
    for run in range(-n_frames, n_runs):  # every frame once before
        clip_time = clip.clip.clip_time(clip.clip.start + run % n_frames)
        started_s = time.perf_counter()
        clip.decode(clip_time, effects)
        times.append(time.perf_counter() - started_s)
    return 1e3 * statistics.median(times[n_frames:])


def main(argv: list[str] | None = None) -> None:
    """Print the table; see the module docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("project", type=Path)
    parser.add_argument("--clip", type=int, default=1)
    parser.add_argument("--runs", type=int, default=20, help="runs that count")
    parser.add_argument("--json", type=Path, help="also write all figures here")
    options = parser.parse_args(argv)
    opened = open_trained(open_project(options.project, is_writable=False))
    trained = opened.load(options.clip)
    named = named_sets(trained.model, opened.header(options.clip), opened.project.settings.reference_clip)
    clip = EditedClip(trained.model, trained.clip, named)
    n_gaussians = len(clip.decode(0.0).gaussians)
    print(f"clip {options.clip}, {n_gaussians:,} Gaussians, median of {options.runs}")
    rows: list[dict[str, Any]] = []
    for name, edits in stacks(clip).items():
        effects = Effects.of(edits) if edits else NO_EFFECTS
        fresh = EditedClip(trained.model, trained.clip, named)
        fresh.decode(0.0)
        started_s = time.perf_counter()
        fresh.decode(0.0, effects)
        first_ms = 1e3 * (time.perf_counter() - started_s)
        frame_ms = measured(fresh, effects, options.runs)
        rows.append({"edits": name, "first_ms": first_ms, "frame_ms": frame_ms, "kept_mb": fresh.n_bytes_kept / 1e6})
        print(
            f"{name:22} first {first_ms:7.1f} ms   frame {frame_ms:7.1f} ms   kept {fresh.n_bytes_kept / 1e6:6.1f} MB"
        )
    if options.json:
        content = {"clip": options.clip, "n_gaussians": n_gaussians, "rows": rows}
        options.json.write_text(json_text(content, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
