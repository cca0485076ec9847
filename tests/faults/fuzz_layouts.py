"""Damaged tables of every layout: opening ends with a message, or with cameras that can be used.

Each case writes one layout of the shared scene and changes one thing in one of its tables. Counted as faults: an
exception that is not an EngineError, a warning of numpy, a hang, a file opened outside of the capture, cameras that
no program could use, and memory above twice the file beside what any opening takes.

    python -m tests.faults.fuzz_layouts --cases 2000 --seed 1
"""

from __future__ import annotations

import random
import resource
import shutil
import sys
import tracemalloc
import warnings
from pathlib import Path

import numpy as np

from tests.faults.mutate_tables import damaged_table, tables_of
from tests.faults.tally import (
    Case,
    Outcome,
    fuzz_main,
    judge,
    start_memory,
    take_outside,
    watch_files,
)

ADDRESS_BYTES = 3 << 30
"""Address space of the process that opens the captures, beside what it has before: an attempt at more is an error."""
OPENING_BYTES = 8 << 20
"""What Python and numpy take for any of these small captures and its pictures: at most 2 MB undamaged."""


def run_case(case: Case) -> Outcome:
    """Damage a capture as index and seed say, open it, and look at what came out."""
    pristine = case.work_dir / "pristine"
    if not pristine.is_dir():
        _prepare(pristine)
        watch_files([case.work_dir])
        start_memory()
    rng = random.Random(f"{case.seed}:{case.index}")
    layout = rng.choice(sorted(path.name for path in pristine.iterdir()))
    folder = case.work_dir / f"case-{case.index}"
    shutil.copytree(pristine / layout, folder)
    path = rng.choice(tables_of(folder))
    what, data = damaged_table(path, rng)
    path.write_bytes(data)
    del data
    take_outside()
    tracemalloc.start()
    verdict, detail = judge(lambda: _open(folder))
    extra = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    outside = take_outside()
    if outside:
        verdict, detail = "outside", ", ".join(outside)
    n_bytes = path.stat().st_size
    if verdict in ("typed", "accepted") and extra > 2 * n_bytes + OPENING_BYTES:
        verdict, detail = "memory", f"{extra / 1e6:.0f} MB for a file of {n_bytes / 1e6:.1f} MB"
    if verdict == "typed" and str(folder) not in detail:
        verdict, detail = "untyped", f"the message names no file: {detail}"
    relative = path.relative_to(folder)
    shutil.rmtree(folder)
    return Outcome(f"{layout}: {relative}, {what}", verdict, detail, n_bytes, extra)


def _prepare(pristine: Path) -> None:
    """Every layout once; what loads at the first use is not a case's memory."""
    from tests.engine.capture.layouts.all_layouts import ALL

    for layout, write in ALL.items():
        write(pristine / layout)
        _open(pristine / layout)
    warnings.simplefilter("error", RuntimeWarning)
    has = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (has + ADDRESS_BYTES, has + ADDRESS_BYTES))


def _open(folder: Path) -> None:
    from engine.capture.capture import open_capture

    capture = open_capture(folder)
    rig = capture.rig
    rotations = rig.world_to_camera[:, :3, :3]
    assert len(rig) >= 1
    assert capture.n_frames >= 1
    assert np.isfinite(rig.Ks).all()
    assert np.isfinite(rig.world_to_camera).all()
    assert np.abs(rotations @ rotations.transpose(0, 2, 1) - np.eye(3)).max() < 1e-2
    assert (np.linalg.det(rotations) > 0).all()
    for camera in range(len(rig)):
        for frame in (0, capture.n_frames - 1):
            width, height = rig.image_sizes[camera]
            assert capture.frame(camera, frame).shape == (height, width, 3)
    capture.close()


if __name__ == "__main__":
    sys.exit(fuzz_main("fuzz_layouts", __doc__ or "", run_case))
