"""Exported files of Gaussians: time to write one and its size next to its error, format by format."""

from __future__ import annotations

import tempfile
import time
from functools import partial
from pathlib import Path

from app.evaluation.headless import TrainedProject
from app.export.gaussians.read_back import ReadBack
from app.export.scene_frames import SceneFrames
from app.lab.bench.rows import Trade
from app.lab.bench.timing import interleaved
from engine.errors import DiskError
from engine.export.formats.table import FORMATS, FULL_PLY, Format
from engine.export.splats import Splats
from engine.export.world import FileWorld

KINDS = FORMATS | {"ply --fields full": FULL_PLY}
"""Formats, and the option that changes the size of a file, by what is written after --format."""
N_RUNS = 3


def measure_exports(opened: TrainedProject) -> list[Trade]:
    """Write the first trained frame in every format and read it again.

    Raises:
        ProjectError: A clip is damaged.
        DiskError: The folder for temporary files cannot be written.
    """
    scene = SceneFrames(opened)
    frame = scene.trained_frames[0]
    live = scene.gaussians(frame)
    splats = Splats.of(live)
    check = ReadBack(scene, FileWorld())
    try:
        with tempfile.TemporaryDirectory() as folder:
            paths = {name: Path(folder, f"{index}{kind.suffix}") for index, (name, kind) in enumerate(KINDS.items())}
            runs = {name: partial(_write, kind, splats, paths[name]) for name, kind in KINDS.items()}
            timings = interleaved(runs, N_RUNS, n_warm=1)
            return [
                Trade(
                    operation="export",
                    line=name.split()[0],
                    setting=name,
                    seconds=timings[name][0].median_ms / 1e3,
                    n_bytes=paths[name].stat().st_size,
                    psnr_db=min(check.psnr_db(_read(kind, paths[name]), frame, live).values()),
                )
                for name, kind in KINDS.items()
            ]
    except OSError as error:
        raise DiskError(f"No file could be written to be measured ({error.strerror}).") from error


def _read(kind: Format, path: Path) -> Splats:
    with path.open("rb") as stream:
        return kind.read(stream)


def _write(kind: Format, splats: Splats, path: Path) -> tuple[float]:
    """Milliseconds."""
    started_s = time.perf_counter()
    with path.open("wb") as stream:
        kind.write(splats, stream)
    return ((time.perf_counter() - started_s) * 1e3,)
