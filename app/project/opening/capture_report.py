"""The contents of a folder in words, before anything is made of it; or why it does not open and what to do."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from engine.camera.lens import Lens
from engine.capture.capture import Capture
from engine.capture.capture_summary import describe
from engine.capture.files.frame_files import VIDEO_SUFFIXES, listed
from engine.capture.formats.table import FORMATS
from engine.capture.pixels.frame_fit import FrameFit
from engine.errors import CaptureError, EngineError
from engine.text import duration_text, printable, rate_text

LAYOUTS = {reader.FORMAT: reader.LAYOUT for reader in FORMATS}
"""Names of layouts, by format."""
LENSES = {
    "pinhole": "no distortion",
    "opencv": "OpenCV distortion",
    "fisheye": "fisheye",
    "fov": "fisheye (FOV)",
    "thin_prism_fisheye": "fisheye with thin prism",
}
MINE = "Copy the files into the folder or, if you trust this capture, open it anyway; its project remembers this."
LEAST_VIDEOS = 2
"""So many videos in a folder without calibration may be cameras of one scene."""


@dataclass(frozen=True, slots=True, eq=False)
class ReportedCamera:
    """One camera as the report shows it.

    Attributes:
        name: As the capture calls it.
        image_size: Width and height as stored.
        lens: In words.
        fov_deg: Horizontal and vertical view of its pictures once they are undistorted.
        center: Its place, scene units. [3]
        forward: Its viewing direction, unit vector. [3]
        is_default_holdout: Whether the capture sets it aside.
        has_masks: Whether masks came along.
    """

    name: str
    image_size: tuple[int, int]
    lens: str
    fov_deg: tuple[float, float]
    center: np.ndarray
    forward: np.ndarray
    is_default_holdout: bool
    has_masks: bool


@dataclass(frozen=True, slots=True, eq=False)
class CaptureReport:
    """The description of a capture.

    Attributes:
        path: Its folder.
        layout: The name of its layout, in words.
        cameras: In the order of the rig.
        n_frames, fps: Of every camera.
        up: Mean upward direction of the pictures, unit vector. [3]
        focus_point: The point that the cameras look at, scene units. [3]
        rig_extent: Largest distance between two cameras, scene units.
        points: Name of a point cloud that came along; empty without one.
        warnings: Sentences about odd but usable things.
        misfit_px: By how many pixels frames have another shape than their calibration; 0 where they have not.
        fit: The user's answer about these frames.
        needs_fit: Whether that has to be said before they can be used.
    """

    path: Path
    layout: str
    cameras: tuple[ReportedCamera, ...]
    n_frames: int
    fps: float
    up: np.ndarray
    focus_point: np.ndarray
    rig_extent: float
    points: str
    warnings: tuple[str, ...]
    misfit_px: float = 0.0
    fit: FrameFit | None = None
    needs_fit: bool = False

    @property
    def rows(self) -> tuple[tuple[str, str], ...]:
        """The report's rows: a label and a text each."""
        cameras = self.cameras
        sizes = _counted([f"{camera.image_size[0]} x {camera.image_size[1]}" for camera in cameras])
        lenses = _counted([camera.lens for camera in cameras])
        widths = [camera.fov_deg[0] for camera in cameras]
        low, high = round(min(widths)), round(max(widths))
        view = f"{low} degrees wide" if low == high else f"{low} to {high} degrees wide"
        n_masks = sum(camera.has_masks for camera in cameras)
        masks = "" if not n_masks else "masks of all cameras" if n_masks == len(cameras) else f"masks of {n_masks}"
        seconds = self.n_frames / max(self.fps, 1e-6)
        came_along = ", ".join(part for part in (masks, self.points and f"points in {self.points}") if part)
        many = "" if len(cameras) == 1 else "s"
        return (
            ("Layout", self.layout),
            ("Cameras", f"{len(cameras)} camera{many}, {sizes}"),
            ("Frames", f"{self.n_frames:,} at {rate_text(self.fps)} per second ({_length_text(seconds)})"),
            ("Lenses", f"{lenses}; {view}"),
            ("Poses", f"all known; the cameras are up to {self.rig_extent:.3g} scene units apart"),
            ("Extras", came_along or "no masks, no point cloud; neither is needed"),
        )

    @property
    def text(self) -> str:
        """All of it, to be copied or printed."""
        lines = [str(self.path), *(f"{name}: {words}" for name, words in self.rows)]
        width = max(len(camera.name) for camera in self.cameras)
        lines += [
            f"  {camera.name:<{width}}  {camera.image_size[0]}x{camera.image_size[1]}  view {camera.fov_deg[0]:.0f} x "
            f"{camera.fov_deg[1]:.0f} degrees  {camera.lens}{'  set aside' if camera.is_default_holdout else ''}"
            for camera in self.cameras
        ]
        lines += [f"Note: {sentence}" for sentence in self.warnings]
        return "\n".join(printable(line) for line in lines)


@dataclass(frozen=True, slots=True)
class RefusedFolder:
    """Why a folder does not open as a capture.

    Attributes:
        path: The folder.
        message: The fault.
        hint: The remedy; may be empty.
        problems: Every problem of it where there are several: the fault and the remedy.
        videos: Videos in it that may be cameras of one scene, where no calibration was found.
        needs_links: Nothing is wrong but that its files lie outside of it, which the user may allow.
    """

    path: Path
    message: str
    hint: str
    problems: tuple[tuple[str, str], ...] = ()
    videos: tuple[Path, ...] = ()
    needs_links: bool = False

    @property
    def text(self) -> str:
        """All of it, to be copied."""
        lines = [printable(str(self.path)), " ".join(part for part in (self.message, self.hint) if part)]
        return "\n".join([*lines, *(" ".join(part for part in problem if part) for problem in self.problems)])


def report_of(capture: Capture) -> CaptureReport:
    """Describe a capture in words. Looks at numbers, not at pixels."""
    found: dict[str, Any] = describe(capture)
    entries = capture.layout.cameras
    up = -capture.rig.world_to_camera[:, 1, :3].mean(axis=0)
    cameras = tuple(
        ReportedCamera(
            name=row["name"],
            image_size=(row["width"], row["height"]),
            lens=lens_text(entry.lens),
            fov_deg=(row["fov_x_deg"], row["fov_y_deg"]),
            center=np.array(row["center"]),
            forward=np.array(row["forward"]),
            is_default_holdout=row["is_default_holdout"],
            has_masks=entry.masks is not None,
        )
        for row, entry in zip(found["cameras"], entries, strict=True)
    )
    points = capture.layout.points
    return CaptureReport(
        path=capture.path,
        layout=LAYOUTS.get(capture.format, capture.format),
        cameras=cameras,
        n_frames=capture.n_frames,
        fps=capture.fps,
        up=up / max(float(np.linalg.norm(up)), 1e-12),
        focus_point=np.array(found["focus_point"]),
        rig_extent=found["rig_extent"],
        points="" if points is None else points.name,
        warnings=capture.warnings,
        misfit_px=capture.layout.misfit_px,
        fit=capture.layout.fit,
        needs_fit=bool(capture.layout.far_off),
    )


def refusal_of(path: Path, error: EngineError) -> RefusedFolder:
    """Put into words why a folder does not open. Reads the folder's list of files."""
    problems: Sequence[EngineError] = error.problems if isinstance(error, CaptureError) else ()
    several = tuple(problem.parts() for problem in problems) if len(problems) > 1 else ()
    if isinstance(error, CaptureError) and error.needs_links:
        found = tuple((problem.message, "") for problem in problems)
        return RefusedFolder(path, error.message, MINE, found, needs_links=True)
    videos = () if several else _videos_in(path)
    is_all = several or error.path in (None, path)  # else the place is said, too
    message, hint = (error.message, error.hint) if is_all else error.parts()
    return RefusedFolder(path, message, hint, several, videos if len(videos) >= LEAST_VIDEOS else ())


def _videos_in(folder: Path) -> tuple[Path, ...]:
    try:
        return tuple(folder / name for name in listed(folder, VIDEO_SUFFIXES))
    except OSError:
        return ()


def lens_text(lens: Lens) -> str:
    """A lens in a few words."""
    return LENSES["pinhole"] if lens.is_pinhole else LENSES[lens.model]


def _counted(words: Sequence[str], write: Callable[[str, int], str] = lambda word, n: f"{n} of {word}") -> str:
    """Words with their numbers, most frequent first; without a number where all are the same."""
    counts = Counter(words).most_common()
    return counts[0][0] if len(counts) == 1 else ", ".join(write(word, n) for word, n in counts)


def _length_text(seconds: float) -> str:
    return f"{seconds:.1f} s" if seconds < 60 else f"{duration_text(seconds)} min"
