"""What tests of videos share: jobs of the made project, and what decoders make of the files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from av.video.reformatter import Interpolation, VideoReformatter
from PIL import Image

from app.evaluation.headless import TrainedProject, open_trained
from app.export.jobs.video import VideoJob
from app.export.scene_frames import SceneFrames
from app.export.video.drawing import draw
from app.export.video.render import WrittenVideo, render_video
from app.export.video.views import camera_view
from app.project.opening.project_access import open_project
from engine.metrics.pictures.colors import to_levels
from tests.app.stored_project import copy_stored

CAMERA = 2
"""Of the made project's four, or the sample's twenty: one that was trained on."""


class Films:
    """Renders jobs of one project into a folder of their own."""

    def __init__(self, opened: TrainedProject, folder: Path) -> None:
        self.opened, self.folder = opened, folder
        folder.mkdir()

    def job(self, name: str, format_name: str, **entries: Any) -> VideoJob:
        """A job that looks through CAMERA unless entries say otherwise."""
        is_elsewhere = entries.get("path") is not None or entries.get("turntable") is not None
        view = {} if is_elsewhere else {"camera": self.opened.capture.rig.names[CAMERA]}
        return VideoJob(**{"out": self.folder / name, "format": format_name, **view, **entries})

    def render(self, name: str, format_name: str, **entries: Any) -> WrittenVideo:
        """Render such a job."""
        return render_video(self.job(name, format_name, **entries), self.opened)

    def live(self, moment: float, camera: int = CAMERA) -> np.ndarray:
        """What a camera sees of a moment. [H, W, 3] uint8"""
        view = camera_view(self.opened.capture.rig, camera, None)(0, moment)
        return to_levels(draw(SceneFrames(self.opened), moment, view).color)

    @property
    def names(self) -> list[str]:
        """What lies in the folder."""
        return sorted(path.name for path in self.folder.iterdir())


@pytest.fixture
def films(opened: TrainedProject, tmp_path: Path) -> Films:
    """Of the made project: a thin row of blobs in front of nothing, 48 x 32 pixels."""
    return Films(opened, tmp_path / "films")


@pytest.fixture(scope="session")
def stored(tmp_path_factory: pytest.TempPathFactory) -> TrainedProject:
    """A small training of the sample's first two clips, frames 0 to 5 of 30, 80 x 60 pixels. Not to be changed."""
    folder = copy_stored(tmp_path_factory.mktemp("stored") / "p")
    return open_trained(open_project(folder, is_writable=False))


@pytest.fixture
def sample_films(stored: TrainedProject, tmp_path: Path) -> Films:
    """Of the sample's training: a room in which things move."""
    return Films(stored, tmp_path / "films")


def images_in(folder: Path) -> list[np.ndarray]:
    """The PNG files of a folder in their order. [H, W, 3] uint8 each"""
    return [np.asarray(Image.open(path)) for path in sorted(folder.iterdir())]


def decoded(path: Path) -> list[np.ndarray]:
    """Pictures of a video by the colours that it says it has. FFmpeg's usual conversion rounds down and is a level too
    dark on average; this one is exact. [H, W, 3] uint8 each"""
    exact = Interpolation.BICUBIC | Interpolation.ACCURATE_RND | Interpolation.FULL_CHR_H_INT
    reformatter = VideoReformatter()
    with av.open(str(path)) as container:
        return [
            reformatter.reformat(frame, format="rgb24", interpolation=exact).to_ndarray()
            for frame in container.decode(video=0)
        ]


def psnr_of(found: np.ndarray, expected: np.ndarray) -> float:
    """Of pictures of levels, dB."""
    error = float(((found.astype(np.float64) - expected) ** 2).mean())
    return 99.0 if error == 0 else float(10 * np.log10(255.0**2 / error))
