"""GaussianSequence: the files of one export of Gaussians, written a few at a time and measured."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from app.export.export_progress import ExportProgress, Report
from app.export.gaussians.file_place import file_meters_per_unit
from app.export.gaussians.gaussian_files import GaussianFile, WrittenPart, base_name, moment_files, static_file
from app.export.gaussians.read_back import ReadBack
from app.export.scene_frames import SceneFrames
from app.export.take import TakeFrame
from engine.camera.rig import CameraRig
from engine.camera.rotations import quats_of
from engine.export.formats.table import Format
from engine.export.splats import Splats
from engine.export.world import FileWorld
from engine.raster.gaussians import Gaussians
from engine.storage.files import open_regular

SCHEMA = 1
_MOST_WRITERS = 4
_MOST_LINES = 6
"""Files that are named one by one."""


@dataclass(frozen=True, slots=True)
class WrittenFile:
    """A file that is there; psnr_db: by camera, None where it was not read back."""

    file: GaussianFile
    n_gaussians: int
    n_dropped: int
    n_bytes: int
    notes: tuple[str, ...]
    psnr_db: dict[str, float] | None = None


class GaussianSequence:
    """Files of some frames of a scene.

    Args:
        scene: The source of frames.
        frames: At least one.
        part: The part of each frame to write.
        kind: The format.
        placement: The scene's place in the files.
        n_threads: To write with; no more than a few are of use.
    """

    def __init__(
        self,
        scene: SceneFrames,
        frames: Sequence[TakeFrame],
        part: WrittenPart,
        kind: Format,
        placement: FileWorld,
        *,
        n_threads: int,
    ) -> None:
        self.name = base_name(scene.opened.project.folder.resolve().name)
        self.files: list[WrittenFile] = []
        self._scene, self._frames, self._kind, self._placement = scene, frames, kind, placement
        self._part: WrittenPart = part
        self._n_writers = min(_MOST_WRITERS, n_threads)
        self._n_frames = max(scene.opened.capture.n_frames, max(one.number for one in frames) + 1)

    # ---------------------------------------------------------------- writing

    def write(self, folder: Path, report: Report) -> None:
        """Write every file into a folder. The first, one in the middle and the last are read back, and every file of
        still parts.

        Raises:
            ProjectError: A clip is damaged, or a value does not fit the format.
            OSError: The disk refused.
        """
        check = ReadBack(self._scene, self._placement)
        middle_too = {self._frames[row].number for row in (0, len(self._frames) // 2, -1)}
        figures: dict[GaussianFile, dict[str, float]] = {}
        pending: deque[Future[WrittenFile]] = deque()
        pool = ThreadPoolExecutor(self._n_writers, thread_name_prefix="export")
        try:
            for one, file, live in self._contents(report):
                future = pool.submit(self._write_file, folder, file, self._placement.placed(Splats.of(live)))
                pending.append(future)
                if file.part == "static" or one.number in middle_too:
                    future.result()
                    with open_regular(folder / file.name) as written:
                        found = self._kind.read(written)
                    figures[file] = check.psnr_db(found, one.frame, live)
                while len(pending) > self._n_writers:  # so many scenes are in memory at most
                    self.files.append(pending.popleft().result())
            self.files += [future.result() for future in pending]
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
        self.files = [replace(written, psnr_db=figures.get(written.file)) for written in self.files]
        self._name_the_only_static(folder)
        report(ExportProgress(len(self._frames), len(self._frames)))

    def _contents(self, report: Report) -> Iterator[tuple[TakeFrame, GaussianFile, Gaussians]]:
        """Each frame with a file of it and the contents. Still parts come again only where they have changed."""
        suffix, n_frames = self._kind.suffix, self._n_frames
        files = moment_files(self.name, suffix, [one.number for one in self._frames], self._part, n_frames)
        still: Gaussians | None = None
        stretch: object = None
        for n_done, one in enumerate(self._frames):
            report(ExportProgress(n_done, len(self._frames)))
            frame = one.frame
            clip_and_effects = (self._scene.clip_at(frame).clip_index, self._scene.effects(frame))
            if self._part in ("static", "split") and clip_and_effects != stretch:
                stretch = clip_and_effects
                found = self._scene.gaussians(frame, "static")
                if still is None or not _are_same(still, found):
                    still = found
                    yield one, static_file(self.name, suffix, one.number, n_frames), found
            if files:
                yield one, files[n_done], self._scene.at_moments(one.moments, files[n_done].part)

    def _write_file(self, folder: Path, file: GaussianFile, splats: Splats) -> WrittenFile:
        path = folder / file.name
        with path.open("wb") as stream:
            notes = self._kind.write(splats, stream)
        return WrittenFile(file, len(splats), splats.n_dropped, path.stat().st_size, notes)

    def _name_the_only_static(self, folder: Path) -> None:
        """Without a number where it holds for all frames."""
        static = [index for index, written in enumerate(self.files) if written.file.part == "static"]
        if len(static) == 1:
            written = self.files[static[0]]
            only = static_file(self.name, self._kind.suffix, None, self._n_frames)
            (folder / written.file.name).rename(folder / only.name)
            self.files[static[0]] = replace(written, file=replace(only, frame=written.file.frame))

    # ---------------------------------------------------------------- what was written

    @property
    def psnr_db(self) -> float | None:
        """The lowest figure of all files and cameras."""
        return min((value for written in self.files for value in (written.psnr_db or {}).values()), default=None)

    def document(self) -> dict[str, Any]:
        """The document that is written next to the files. Its cameras are those of the capture as refined, where they
        stand in the files. In units of the files are meters_per_unit, null where the project does not say, and
        near_plane, the nearest depth that is drawn."""
        opened = self._scene.opened
        return {
            "schema": SCHEMA,
            "program": "ClipGStream Studio",
            "project": opened.project.folder.resolve().name,
            "first_frame": min(one.number for one in self._frames),
            "last_frame": max(one.number for one in self._frames),
            "n_frames": len(self._frames),
            "fps": opened.capture.fps,
            "axes": self._placement.text,
            "up": [round(value, 6) for value in self._placement.up],
            "scale": self._placement.scale,
            "quat": quats_of(self._placement.rotation).tolist(),
            "meters_per_unit": file_meters_per_unit(opened, self._placement),
            "psnr_db": self.psnr_db,
            "min_psnr_db": self._kind.min_psnr_db,
            "lines": list(self.lines()),
            "files": [
                {
                    "file": written.file.name,
                    "part": written.file.part,
                    "frame": written.file.frame,
                    "n_gaussians": written.n_gaussians,
                    "n_dropped": written.n_dropped,
                    "n_bytes": written.n_bytes,
                    "psnr_db": written.psnr_db,
                }
                for written in self.files
            ],
            "near_plane": self._near_plane * self._placement.scale,
            "cameras": camera_rows(opened.rig, self._placement),
        }

    @property
    def _near_plane(self) -> float:
        """Nearest depth that is drawn, scene units."""
        return self._scene.trained(self._frames[0].frame).base.header.near_plane

    def lines(self) -> tuple[str, ...]:
        """Sentences for the user: where the scene lies, how near files come, and what was left out."""
        lines = [f"Coordinates: {self._placement.text}."]
        lines += self._measured_lines()
        for note, n in Counter(note for written in self.files for note in written.notes).items():
            lines.append(note if n == 1 else f"{note} So in {n} files.")
        n_dropped = sum(written.n_dropped for written in self.files)
        if n_dropped:
            lines.append(f"{n_dropped:,} Gaussians that cannot be drawn were left out.")
        n_empty = sum(written.n_gaussians == 0 for written in self.files)
        if n_empty:
            files = "One file holds" if n_empty == 1 else f"{n_empty} files hold"
            lines.append(f"{files} no Gaussians: this part of the scene is empty.")
        return tuple(lines)

    def _measured_lines(self) -> list[str]:
        """The lowest figure of each file that was read back, or of all where they are many; bad ones as warnings."""
        lowest = {written.file.name: min(written.psnr_db.values()) for written in self.files if written.psnr_db}
        good = {name: value for name, value in lowest.items() if value >= self._kind.min_psnr_db}
        bad = {name: value for name, value in lowest.items() if name not in good}
        said = "against the live picture, in the worst of the cameras it was drawn from"
        if len(good) > _MOST_LINES:
            name = min(good, key=good.__getitem__)
            lines = [f"{len(good)} files were read back and compared; the worst is {name}: {good[name]:.1f} dB {said}."]
        else:
            lines = [f"{name}: {value:.1f} dB {said}." for name, value in good.items()]
        for name, value in list(bad.items())[:_MOST_LINES]:
            lines.append(
                f"Warning: {name}: {value:.1f} dB {said}. At least {self._kind.min_psnr_db:.0f} dB were expected of "
                f"{self._kind.suffix}; check the file before use."
            )
        return lines


def camera_rows(rig: CameraRig, placement: FileWorld) -> list[dict[str, Any]]:
    """Cameras as the document lists them: name, size in pixels, intrinsics (pixel centres at +0.5), and the upper three
    rows of camera_to_world in the coordinates of the files (x right, y down, z forward)."""
    poses = placement.placed_cameras(rig.world_to_camera)[:, :3]
    return [
        {"name": name, "image_size": size.tolist(), "K": K.tolist(), "camera_to_world": pose.tolist()}
        for name, size, K, pose in zip(rig.names, rig.image_sizes, rig.Ks, poses, strict=True)
    ]


def _are_same(a: Gaussians, b: Gaussians) -> bool:
    return len(a) == len(b) and all(
        np.array_equal(one.numpy(), other.numpy()) for one, other in zip(a.tensors(), b.tensors(), strict=True)
    )
