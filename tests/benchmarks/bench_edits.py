"""What edits, objects and copies cost: making a frame of a trained project, and what is kept in memory for it.

    python -m tests.benchmarks.bench_edits PROJECT
    python -m tests.benchmarks.bench_edits PROJECT --clip 1 --runs 40 --json edits.json

Frames of one clip are made in turn, after each was made once. "First" is the first frame after the stack has changed,
as during a drag. The object is all that moves; a copy shows it three frames later, and nothing of copies is kept.
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
from engine.editing.copies.copied import Copier, CopySource
from engine.editing.copies.copy_moments import CopyMoments
from engine.editing.copies.object_copy import ObjectCopy
from engine.editing.edit import (
    Box,
    Edit,
    Everything,
    KeyedVolume,
    ObjectTarget,
    Picked,
    PickedRows,
    Sphere,
    VolumeKey,
)
from engine.editing.edited_clip import EditedClip
from engine.editing.effects import EditStack
from engine.editing.picks import pack_rows
from engine.editing.scene_object import ObjectInClip, SceneObject
from engine.objects.moving_parts import ROLES
from engine.storage.json_files import json_text
from tests.documents.table import table


def stacks(clip: EditedClip) -> dict[str, EditStack]:
    """Stacks by name, which act on a good part of the scene each."""
    found = clip.decode(0.0)
    means = found.gaussians.means.numpy()
    middle = tuple(float(value) for value in np.median(means, axis=0))
    radius = float(np.median(np.linalg.norm(means - middle, axis=1)))
    places = [place for place in range(len(found.rows.sets)) if (found.rows.set_index == place).any()]

    def every(step: int) -> Picked:
        return Picked(
            tuple(
                PickedRows(
                    one.clip_index, one.origin, one.role, pack_rows(numbers[found.rows.set_index == place][::step])
                )
                for place in places
                for one in (found.rows.sets[place],)
            )
        )

    numbers = found.rows.number
    picked, everything = every(3), every(1)
    targets = (Sphere(middle, radius), Box(middle, (radius, radius, radius)), picked)  # type: ignore[arg-type]
    actions = (Recolor(tint_share=0.2), Expose(0.5), Transform((0.01, 0.0, 0.0)), Delete())
    twenty = tuple(Edit(i, "", targets[i % 3], actions[i % 4] if i > 15 else actions[i % 3]) for i in range(20))
    moved = Sphere((middle[0] + radius, middle[1], middle[2]), radius)  # type: ignore[arg-type]
    keyed = KeyedVolume((VolumeKey(clip.clip.start, targets[0]), VolumeKey(clip.clip.stop, moved)))
    moving = Picked(tuple(one for one in everything.sets if one.role in ROLES))
    one = SceneObject(0, "what moves", clips=(ObjectInClip(clip.clip.start, clip.clip.stop, moving.sets),))
    copies = tuple(
        ObjectCopy(i, f"copy {i}", 0, Transform((i * radius, 0.0, 0.0)), shift_frames=3.0, outside="loop")
        for i in (1, 2)
    )
    return {
        "none": EditStack(),
        "1 deletes a sphere": EditStack((Edit(0, "", targets[0], Delete()),)),
        "1 deletes a sphere that moves": EditStack((Edit(0, "", keyed, Delete()),)),
        "1 deletes an object": EditStack((Edit(0, "", ObjectTarget(0), Delete()),), (one,)),
        "2 copies of an object": EditStack((), (one,), copies),
        "20 mixed": EditStack(twenty),
        "1 holds": EditStack((Edit(0, "", Everything(), Hold(clip.clip.start)),)),
        "1 smooths, sigma 2": EditStack((Edit(0, "", Everything(), Smooth(2.0)),)),
    }


def made(clip: EditedClip, stack: EditStack, copies: CopyMoments, frame_index: int) -> float:
    """Seconds that making a frame takes; copies are made afresh."""
    started_s = time.perf_counter()
    edited = clip.decode(clip.clip.clip_time(frame_index), stack.at(frame_index))
    if copied := copies.at(frame_index):
        Copier().with_copies(edited, copied, lambda moment: CopySource("this clip", lambda: clip))
    return time.perf_counter() - started_s


def measured(clip: EditedClip, stack: EditStack, n_runs: int) -> float:
    """Median of making a frame, ms."""
    n_frames, copies = clip.clip.n_frames, CopyMoments(stack)
    times = [
        made(clip, stack, copies, clip.clip.start + run % n_frames)
        for run in range(-n_frames, n_runs)  # every frame once before
    ]
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
    for name, stack in stacks(clip).items():
        fresh = EditedClip(trained.model, trained.clip, named)
        fresh.decode(0.0)
        first_ms = 1e3 * made(fresh, stack, CopyMoments(stack), clip.clip.start)
        frame_ms = measured(fresh, stack, options.runs)
        rows.append({"edits": name, "first_ms": first_ms, "frame_ms": frame_ms, "kept_mb": fresh.n_bytes_kept / 1e6})
    shown = [(row["edits"], *(f"{row[key]:.1f}" for key in ("first_ms", "frame_ms", "kept_mb"))) for row in rows]
    print(table(("edits", "first ms", "frame ms", "kept MB"), shown))
    if options.json:
        content = {"clip": options.clip, "n_gaussians": n_gaussians, "rows": rows}
        options.json.write_text(json_text(content, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
