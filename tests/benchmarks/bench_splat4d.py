"""Files over time: size, likeness to the live picture, and the time to reach any frame, of one trained project.

    python -m tests.benchmarks.bench_splat4d PROJECT OUT [--splat4d PROGRAM] [--formats 4dgs,tsog]

OUT gets the files; those that are there are taken as they are. The project's own clips and the page with a data folder
come first, then every format of engine.export.sequences, then .splat4d, which the program `splat4d` (PyPI: splats4d)
packs from a .splat file per frame; without it these rows are left out. It wants the same number of Gaussians in every
frame, each in its place: so each gets a row for as long as it exists, and rows without one are invisible. Likeness is
the lowest PSNR of five frames from three cameras. A seek is the median of ten frames drawn by chance: clips are read
and decoded, other files are open; of splat4d it is its own command, start and writing included.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

from app.background.kernels import use_threads
from app.evaluation.headless import TrainedProject, open_trained
from app.export.gaussians.read_back import ReadBack
from app.export.jobs.player import PlayerJob
from app.export.player_job import run as export_player
from app.export.scene_frames import SceneFrames
from app.export.sequences.scene_stretches import SceneStretches
from app.export.take import TakeFrame, take_frames
from app.project.opening.project_access import open_project
from engine.export.formats import splat
from engine.export.player.blocks import joined
from engine.export.sequences.sequence import SequenceTiming
from engine.export.sequences.table import SEQUENCES
from engine.export.splats import Splats
from engine.export.world import FileWorld
from tests.benchmarks.options import ending_on_bad_input, names
from tests.documents.table import table

N_CHECKED, N_SEEKS = 5, 10
SPLAT4D = {
    "its default": (),
    "coarse": ("--pos-mm", "5", "--color-levels", "8", "--rot-steps", "2", "--scale-pct", "5"),
}
COLUMNS = ("file", "MB", "kB per frame", "PSNR at least, dB", "written in, s", "opened in, s", "seek, ms")


class Bench:
    """One project and its figures, row by row.

    Args:
        opened: All of its frames are measured.
        out: For files.
    """

    def __init__(self, opened: TrainedProject, out: Path) -> None:
        self.opened, self.out = opened, out
        self.scene = SceneFrames(opened)
        self.frames: list[TakeFrame] = take_frames(self.scene, None, has_timing=False)
        self.check = ReadBack(self.scene, FileWorld())
        self.seeks = np.random.default_rng(0).integers(0, len(self.frames), N_SEEKS).tolist()
        self.rows: list[tuple[str, ...]] = []

    def stretches(self) -> SceneStretches:
        """As they are exported."""
        return SceneStretches(self.scene, self.frames, FileWorld(), lambda _: None)

    def add(
        self,
        name: str,
        n_bytes: int,
        read: Callable[[int], Splats] | None,
        *,
        seek: Callable[[int], object] | None,
        written_s: float | None = None,
        opened_s: float | None = None,
    ) -> None:
        """A row. read: a frame of the file, None where it is not compared."""
        psnr_db = None
        if read is not None:
            numbers = np.unique(np.linspace(0, len(self.frames) - 1, N_CHECKED).round().astype(int)).tolist()
            frames = {number: self.frames[number].frame for number in numbers}
            live = {number: self.scene.gaussians(frame) for number, frame in frames.items()}
            psnr_db = min(
                min(self.check.psnr_db(read(number), frames[number], live[number]).values()) for number in numbers
            )
        seek_ms = None if seek is None else 1e3 * float(np.median([seconds(seek, number) for number in self.seeks]))
        cells = (
            f"{n_bytes / 1e6:.2f}",
            f"{n_bytes / 1e3 / len(self.frames):.0f}",
            _cell(psnr_db, ".1f"),
            _cell(written_s, ".1f"),
            _cell(opened_s, ".2f"),
            _cell(seek_ms, ".0f"),
        )
        self.rows.append((name, *cells))

    def clips(self) -> None:
        """Files of clips, with what they inherit."""
        project = self.opened.project
        n_bytes = sum(project.clip_path(clip_index).stat().st_size for clip_index in self.opened.trained)
        self.add("clips of the project", n_bytes, None, seek=self._decoded)

    def _decoded(self, number: int) -> object:
        """A frame of a scene that has nothing in memory."""
        return SceneFrames(self.opened).gaussians(self.frames[number].frame)

    def player(self) -> None:
        """The page and its folder."""
        job = PlayerJob(out=self.out / "page.html", has_folder=True)
        written_s = None if job.out.exists() else seconds(lambda _: export_player(self.opened, job, lambda _: None), 0)
        n_bytes = job.out.stat().st_size + sum(path.stat().st_size for path in job.folder.iterdir())
        self.add("page with a data folder", n_bytes, None, seek=None, written_s=written_s)

    def sequence(self, name: str) -> None:
        """A file over time."""
        kind, path, written_s = SEQUENCES[name], self.out / f"scene{SEQUENCES[name].suffix}", None
        timing = SequenceTiming(len(self.frames), float(self.opened.capture.fps))
        if not path.exists():
            written_s = seconds(lambda _: kind.write(self.stretches(), timing, path), 0)
        start = time.perf_counter()
        reader = kind.open(path)
        opened_s = time.perf_counter() - start
        self.add(
            kind.suffix,
            path.stat().st_size,
            reader.splats,
            seek=reader.splats,
            written_s=written_s,
            opened_s=opened_s,
        )
        reader.close()

    def splat4d(self, program: str) -> None:
        """Files that another program packs."""
        folder, one = self.out / "splat_frames", self.out / "decoded.splat"
        if not folder.exists():
            write_rows(self.stretches(), folder)
        self.add(
            ".splat, a file per frame, in rows that stay",
            sum(path.stat().st_size for path in folder.iterdir()),
            lambda number: _visible(folder / f"frame_{number:04d}.splat"),
            seek=None,
        )
        for setting, options in SPLAT4D.items():
            path, written_s = self.out / f"{setting.replace(' ', '_')}.splat4d", None
            if not path.exists():
                called = [program, "encode", "-i", str(folder), "-o", str(path), *options]
                written_s = seconds(lambda _, called=called: subprocess.run(called, check=True, capture_output=True), 0)

            def decode(number: int, path: Path = path) -> Splats:
                called = [program, "decode", str(path), "--frame", str(number), "-o", str(one)]
                subprocess.run(called, check=True, capture_output=True)
                return _visible(one)

            self.add(f".splat4d, {setting}", path.stat().st_size, decode, seek=decode, written_s=written_s)


def seconds(work: Callable[[int], object], number: int) -> float:
    """How long it takes."""
    start = time.perf_counter()
    work(number)
    return time.perf_counter() - start


def _visible(path: Path) -> Splats:
    with path.open("rb") as file:
        found = splat.read(file)
    return found[found.opacities > 0.0]


def _cell(value: float | None, form: str) -> str:
    return "" if value is None else format(value, form)


def write_rows(stretches: SceneStretches, folder: Path) -> None:
    """A .splat file per frame with as many rows in each. What exists from one frame to the next keeps its row, and what
    stands still the same one throughout; a row without a Gaussian is that of the last one, invisible."""
    folder.mkdir()
    shown: dict[object, int] = {}
    free: list[int] = []
    frames: list[tuple[np.ndarray, np.ndarray]] = []
    n_rows = 0
    for stretch_index, stretch in enumerate(stretches):
        for frame in range(stretch.first_frame, stretch.first_frame + stretch.n_frames):
            moving = stretch.moving(frame)
            splats = joined(stretch.still, moving.splats)
            names = [None] * len(stretch.still) + [(stretch_index, name) if name >= 0 else None for name in moving.ids]
            keys = [name or shape for name, shape in zip(names, _shapes(splats), strict=True)]
            for key in shown.keys() - set(keys):
                free.append(shown.pop(key))
            for key in keys:
                if key not in shown:
                    shown[key] = free.pop() if free else n_rows
                    n_rows = max(n_rows, shown[key] + 1)
            frames.append((splat.packed_rows(splats), np.array([shown[key] for key in keys])))
    rows = np.zeros(n_rows, frames[0][0].dtype)
    rows["scale"], rows["quat"] = 1e-3, (255, 128, 128, 128)
    for number, (packed, places) in enumerate(frames):
        rows["rgba"][:, 3] = 0
        rows[places] = packed
        (folder / f"frame_{number:04d}.splat").write_bytes(rows.tobytes())


def _shapes(splats: Splats) -> list[object]:
    """A name for each row by everything but its colour; equal rows are numbered."""
    columns = (splats.means, splats.quats, splats.scales, splats.opacities[:, None])
    seen: Counter[bytes] = Counter()
    found: list[object] = []
    for row in np.concatenate(columns, axis=1):
        name = row.tobytes()
        found.append((name, seen[name]))
        seen[name] += 1
    return found


def main() -> None:
    """Command line; see the module docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("project", type=Path)
    parser.add_argument("out", type=Path, help="folder for the files")
    parser.add_argument("--formats", default=",".join(SEQUENCES), help="names separated by commas")
    parser.add_argument("--splat4d", default=shutil.which("splat4d"), help="the program, where it is not on the path")
    options = parser.parse_args()
    chosen = names(options.formats, list(SEQUENCES), parser)
    use_threads(None)
    options.out.mkdir(parents=True, exist_ok=True)
    with ending_on_bad_input():
        bench = Bench(open_trained(open_project(options.project, is_writable=False)), options.out)
        bench.clips()
        bench.player()
        for name in chosen:
            bench.sequence(name)
        if options.splat4d:
            bench.splat4d(options.splat4d)
    print(table(COLUMNS, bench.rows))


if __name__ == "__main__":
    main()
