"""Jobs that cannot be done: each is refused with a reason before anything is written."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.evaluation.headless import TrainedProject
from app.export.jobs.video import Turntable, VideoJob
from app.export.scene_frames import SceneFrames
from app.export.video.plan import plan_video
from engine.camera.corrections import N_VALUES
from engine.clip_files.array_names import CORRECTIONS
from engine.clip_files.clip_state import ClipState
from engine.errors import CaptureError, EngineError
from tests.app.export.video.conftest import Films


@pytest.mark.parametrize(
    ("format_name", "entries", "message"),
    [
        ("gif", {}, "Format is 'gif'; it has to be 'mp4', 'webm'"),
        ("png", {"camera": None}, "give one of these three"),
        ("png", {"turntable": Turntable(), "camera": "1"}, "give one of these three"),
        ("png", {"camera": "nobody"}, "no camera called nobody"),
        ("png", {"shows": "heat"}, "Shows is 'heat'; it has to be 'color'"),
        ("png", {"size": (0, 10)}, "Size is .0, 10.; it has to be WIDTHxHEIGHT"),
        ("png", {"size": (9000, 10), "supersampling": 2}, "18000 x 20 pixels; at most 16384"),
        ("png", {"size": (4000, 4000), "supersampling": 4}, "134 million in all"),
        ("png", {"supersampling": 0}, "a whole number between 1 and 8"),
        ("png", {"fps": 0.0}, "Rate is 0.0; it has to be a number between 0.1 and 1000"),
        ("png", {"fps": float("nan")}, "Rate is nan"),
        ("png", {"speed": -1.0}, "Speed is -1"),
        ("png", {"hold": 6.0}, "no frame 6"),
        ("png", {"frames": range(4, 4)}, "at least one"),
        ("png", {"frames": range(4, 99)}, "not all of which"),
        ("png", {"background": (0, 0, 256)}, "#RRGGBB, such as #ffffff, with numbers between 0 and 255"),
        ("png", {"sound": "0"}, "PNG files cannot hold sound"),
        ("mp4", {"sound": "0"}, "its frames are image files"),
        ("mp4", {"is_transparent": True}, "H.264 in mp4 has no transparency"),
        ("exr", {"background": (1, 2, 3)}, "keep the opacity"),
        ("exr", {"shows": "compare"}, "cannot hold three pictures"),
        ("png", {"shows": "depth", "is_transparent": True}, "Only pictures in colour"),
        ("png", {"shows": "compare", "turntable": Turntable()}, "needs a camera of the capture"),
        ("png", {"shows": "compare", "hold": 1.0}, "needs a camera of the capture"),
        ("png", {"turntable": Turntable(n_turns=0.0)}, "0 turns"),
    ],
)
def test_what_makes_no_sense_is_refused(films: Films, format_name: str, entries: dict[str, Any], message: str):
    with pytest.raises(EngineError, match=message):
        films.render("out", format_name, **entries)
    assert films.names == []


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ({"n_turns": float("nan")}, "Turns is nan; it has to be a number between -100 and 100"),
        ({"elevation_deg": 120.0}, "Elevation is 120"),
        ({"radius": 0.0}, "Distance is 0"),
    ],
)
def test_a_circle_that_cannot_be_is_refused(entries: dict[str, float], message: str):
    with pytest.raises(EngineError, match=message):
        Turntable(**entries)


def test_a_place_that_cannot_be_written_is_refused_before_the_work(films: Films):
    (films.folder / "file").write_text("x")
    for name, message in (("file/a.mp4", "is a file"), (".", "folder, not a file")):
        with pytest.raises(EngineError, match=message):
            films.render(name, "mp4")
    assert films.names == ["file"]


def test_a_video_without_end_is_refused(films: Films, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("app.export.video.plan.MAX_PICTURES", 100)
    with pytest.raises(EngineError, match="That makes 501 pictures; at most 100 are written at once"):
        films.render("out", "png", speed=0.01)
    assert films.names == []


def test_what_a_camera_took_has_to_be_there_for_the_comparison(films: Films):
    capture = films.opened.capture
    (next((capture.path / "ims" / "2").glob("*5.jpg"))).unlink()
    with pytest.raises(CaptureError, match="missing"):
        films.render("beside", "png", shows="compare")
    assert films.names == []


def test_a_camera_that_was_refined_is_looked_through_as_it_was_refined(opened: TrainedProject, tmp_path: Path):
    rig, reference = opened.capture.rig, opened.reference
    assert reference is not None
    names = reference.header.camera_names
    values = np.zeros((len(names), N_VALUES), np.float32)
    values[0, :3] = 0.01
    refined = replace(opened, reference=ClipState(reference.arrays | {CORRECTIONS: values}, reference.header))
    index = rig.names.index(names[0])
    assert not np.allclose(refined.rig.world_to_camera[index], rig.world_to_camera[index])
    job = VideoJob(out=tmp_path / "a", format="png", camera=names[0])
    for project in (opened, refined):
        view = plan_video(job, SceneFrames(project)).view_of(0, 0.0)
        assert np.array_equal(view.world_to_camera, project.rig.world_to_camera[index])
