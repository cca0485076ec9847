"""Damaged files of COLMAP, N3DV and point clouds: a message or a correct reading, no hang, no more memory than twice
the file.

Each case damages the bytes of one file with cameras, poses or points, or puts something else under its name, and opens
the capture and its points. Counted as faults: an exception that is not an EngineError, a reading with NaN or with
poses that are not rigid, and more memory than twice the largest file and a fixed megabyte.

    python -m tests.faults.fuzz_colmap --cases 2000 --seed 1
"""

from __future__ import annotations

import random
import shutil
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tests.engine.capture.layouts import (
    written_colmap,
    written_colmap_frames,
    written_multipleview,
    written_n3dv,
)
from tests.engine.capture.layouts.scene import make_scene
from tests.faults.mutate import damaged_bytes, put_odd_file
from tests.faults.tally import Case, Outcome, fuzz_main, judge

SUFFIXES = (".bin", ".txt", ".npy", ".ply", ".npz")
N_POINTS = 4000
N_FEATURES = 1500
FIXED_BYTES = 1 << 20
"""What opening a capture takes anyway, whatever the size of its files."""
_made: dict[Path, dict[str, Path]] = {}


def make_captures(folder: Path) -> dict[str, Path]:
    """Small captures by name, with clouds of every kind beside them."""
    cloud = np.random.default_rng(1).uniform(-1, 1, (N_POINTS, 3))
    found = {}
    for kind in ("binary", "text"):
        scene = make_scene(lens="opencv4", n_frames=2)
        found[kind] = folder / kind
        written_colmap.write(folder / kind, scene, lens="opencv4", frames="folders")
        shutil.rmtree(folder / kind / "sparse")
        written_colmap.write_model(
            folder / kind / "sparse/0",
            scene,
            "OPENCV",
            is_binary=kind == "binary",
            points=cloud,
            n_features=N_FEATURES,
        )
    scene = make_scene(lens="pinhole", is_centered=True, is_one_focal=True, n_frames=2)
    found["n3dv"] = folder / "n3dv"
    written_n3dv.write(folder / "n3dv", scene, frames="images")
    found["frames"] = folder / "frames"
    written_colmap_frames.write(folder / "frames", make_scene(lens="fisheye", n_frames=2), lens="fisheye")
    found["multipleview"] = folder / "multipleview"
    written_multipleview.write(
        folder / "multipleview",
        make_scene(lens="opencv5", names=written_multipleview.NAMES, n_frames=2),
        lens="opencv5",
    )
    _write_clouds(folder, cloud)
    return found


def _write_clouds(folder: Path, cloud: np.ndarray) -> None:
    from engine.capture.points import CapturePoints
    from engine.capture.writers.point_files import write_ply

    colors = (255 * np.abs(cloud)).astype(np.uint8)
    write_ply(folder / "n3dv/points3D_downsample2.ply", CapturePoints(cloud, colors))
    rows = np.column_stack([cloud, colors])
    header = "ply\nformat ascii 1.0\nelement vertex {}\n" + "".join(f"property float {name}\n" for name in "xyz")
    header += "".join(f"property uchar {name}\n" for name in ("red", "green", "blue")) + "end_header\n"
    lines = [" ".join([*(f"{value:.7f}" for value in row[:3]), *(f"{value:.0f}" for value in row[3:])]) for row in rows]
    (folder / "multipleview/points3D_multipleview.ply").write_text(header.format(len(rows)) + "\n".join(lines) + "\n")
    (folder / "frames/plys").mkdir()
    np.savez(folder / "frames/plys/0.npz", data=np.column_stack([cloud, colors / 255, np.ones(len(cloud))]))


def run_case(case: Case) -> Outcome:
    """Damage a file as index and seed say, and open the capture and its points."""
    rng = random.Random(f"{case.seed}:{case.index}")
    if case.work_dir not in _made:
        _made[case.work_dir] = make_captures(case.work_dir / "pristine")
        for folder in _made[case.work_dir].values():
            _look(folder)  # what loads at the first use is not the case's memory
    name = rng.choice(sorted(_made[case.work_dir]))
    folder = case.work_dir / f"case-{case.index}"
    shutil.copytree(_made[case.work_dir][name], folder)
    files = sorted(path for path in folder.rglob("*") if path.suffix in SUFFIXES)
    path = rng.choice(files)
    if rng.random() < 0.08:
        what = put_odd_file(path, rng)
    else:
        what, data = damaged_bytes(path.read_bytes(), rng)
        path.write_bytes(data)
    n_bytes = path.stat().st_size if path.is_file() else 0
    verdict, detail, peak = _measured(lambda: _look(folder))
    largest = max((other.stat().st_size for other in files if other.is_file()), default=0)
    if verdict in ("typed", "accepted") and peak > 2 * max(n_bytes, largest) + FIXED_BYTES:
        verdict, detail = "untyped", f"{peak} bytes of memory"
    shutil.rmtree(folder)
    return Outcome(f"{name}/{path.relative_to(folder)}: {what}", verdict, detail, n_bytes)


def _measured(act: Callable[[], object]) -> tuple[str, str, int]:
    """Verdict, message and the peak of memory, in bytes."""
    tracemalloc.start()
    try:
        verdict, detail = judge(act)
        return verdict, detail, tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def _look(folder: Path) -> None:
    from engine.capture.capture import open_capture
    from engine.capture.points import read_points
    from engine.errors import EngineError

    refused: EngineError | None = None
    clouds = [path for path in folder.rglob("*") if path.suffix in (".ply", ".npz") or path.stem == "points3D"]
    for path in clouds:
        try:
            cloud = read_points(path)
        except EngineError as error:
            refused = error
            continue
        assert np.isfinite(cloud.points).all()
        assert cloud.colors is None or cloud.colors.shape == cloud.points.shape
    capture = open_capture(folder)
    assert len(capture.rig) > 0
    assert all(np.isfinite(array).all() for array in (capture.rig.Ks, capture.rig.world_to_camera))
    rotations = capture.rig.world_to_camera[:, :3, :3]
    assert np.abs(rotations @ rotations.transpose(0, 2, 1) - np.eye(3)).max() < 0.01
    assert capture.frame(0, 0).dtype == np.uint8
    capture.close()
    if refused is not None:
        raise refused


if __name__ == "__main__":
    sys.exit(fuzz_main("fuzz_colmap", __doc__ or "", run_case))
