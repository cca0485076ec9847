"""A made project with two clips of three frames that can be rendered, in which cameras have colours and drift."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from app.playback.playback import Playback
from app.playback.timeline import Timeline
from app.project.clips.clip_catalog import ClipCatalog
from app.project.opening.opened_project import OpenedProject, opened_project
from app.project.opening.project_access import open_project
from app.project.project import Project
from app.residuals.residuals import Residuals
from app.training.service import ShownState
from engine.capture.capture import open_capture
from engine.clip_files.clip_state import ClipState, read_clip_state, write_clip_state
from tests.app.fakes import write_capture
from tests.app.lab.report.made_up import train
from tests.clip_headers import with_header

DEADLINE_S = 300.0
TRAINED_ON = ("1", "2", "3")


def color(path: Path, *, seed: int, reference: str | None = None) -> str:
    """Give the cameras of a clip file colours and drift of their own. Its fingerprint then."""
    random = np.random.default_rng(seed)
    state = read_clip_state(path)
    entries = {"camera_names": list(TRAINED_ON), "near_plane": 0.1, "spacing": 0.2}
    if reference is not None:
        entries["reference_fingerprint"] = reference
    arrays = {**state.arrays, "log_drift": random.uniform(-0.1, 0.1, (3, 3, 3)).astype(np.float32)}
    if state.is_reference:
        arrays["gains"] = random.uniform(0.8, 1.2, (3, 3)).astype(np.float32)
    stamped = with_header(ClipState(arrays, state.header), **entries).stamped()
    write_clip_state(path, stamped)
    return stamped.header.fingerprint


def write_still_capture(folder: Path) -> Path:
    """Four cameras and six frames, in which a bright square moves over what stands still."""
    write_capture(folder, size=(48, 32))
    for camera in range(4):
        still = np.random.default_rng(camera).integers(40, 120, (8, 12, 3), dtype=np.uint8).repeat(4, 0).repeat(4, 1)
        for frame, path in enumerate(sorted((folder / "ims" / str(camera)).iterdir())):
            picture = still.copy()
            picture[8:20, 4 + 4 * frame : 14 + 4 * frame] = 230
            Image.fromarray(picture).save(path, quality=95)
    return folder


def make_project(folder: Path, **overrides: Any) -> Path:
    """A project of such a capture with both clips trained."""
    project = train(folder / "p", write_still_capture(folder / "ring"), **overrides)
    reference = color(project / "clips" / "0000.safetensors", seed=1)
    color(project / "clips" / "0001.safetensors", seed=2, reference=reference)
    return project


class Opened:
    """An open project with residuals, as a session composes them."""

    def __init__(self, folder: Path, *, is_writable: bool = True, **arguments: object) -> None:
        self.project: Project = open_project(folder, is_writable=is_writable)
        capture = open_capture(self.project.settings.capture)
        self.opened: OpenedProject = opened_project(capture, self.project, 1)
        self.catalog = ClipCatalog(self.project, len(self.opened.clips))
        self.playback = Playback(self.state_of)
        self.playback.show(self.opened)
        self.timeline = Timeline(self.opened.clips)
        self.residuals = Residuals(self.playback, **arguments)  # type: ignore[arg-type]
        self.residuals.open(self.opened, self.catalog)

    def state_of(self, clip_index: int) -> ShownState | None:
        record = self.catalog[clip_index]
        return None if record.file is None else ShownState(record.file, record.revision)

    def heat(self, camera: int, frame: int, kind: str) -> Any:
        """The finished map."""
        self.timeline.seek(frame)
        return until(lambda: self.residuals.heat(self.timeline, camera, kind), lambda map_: not map_.is_stale, self)

    def close(self) -> None:
        self.residuals.close()
        self.playback.close()
        self.project.close()
        self.opened.capture.close()


def until(ask: Callable[[], Any], is_right: Callable[[Any], bool], opened: Opened) -> Any:
    """Ask until something comes; what failed is raised."""
    until_s = time.monotonic() + DEADLINE_S
    while True:
        found = ask()
        if found is not None and is_right(found):
            return found
        for failure in opened.residuals.take_failures():
            raise failure.error
        assert time.monotonic() < until_s
        time.sleep(0.001)


@pytest.fixture
def project(tmp_path: Path) -> Path:
    return make_project(tmp_path)


@pytest.fixture
def open_residuals(project: Path) -> Iterator[Callable[..., Opened]]:
    """Opens the project; closes it in the end."""
    made: list[Opened] = []

    def make(**arguments: object) -> Opened:
        made.append(Opened(project, **arguments))  # type: ignore[arg-type]
        return made[-1]

    yield make
    for opened in made:
        opened.close()
