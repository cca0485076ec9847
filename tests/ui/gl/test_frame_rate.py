"""Laps of the window's OpenGL: what is drawn, and what the program says."""

import sys
from pathlib import Path

import pytest

from app.evaluation.headless import open_trained
from app.evaluation.speed.laps import frames_of
from app.project.opening.project_access import open_project
from tests.app.fakes import write_capture
from tests.app.lab.report.made_up import change_header, train
from ui import frame_rate
from ui.gl.context import ContextError

HEADER = {"camera_names": [], "near_plane": 0.1, "spacing": 0.2}


@pytest.fixture
def project(tmp_path: Path) -> Path:
    project = train(tmp_path / "p", write_capture(tmp_path / "ring", n_cameras=4, size=(48, 32)))
    for path in (project / "clips").iterdir():
        change_header(path, **HEADER)
    return project


def test_every_frame_but_the_first_of_a_clip_is_a_lap_of_all_its_gaussians(ctx, project):
    opened = open_trained(open_project(project, is_writable=False))
    now = iter(range(1000))
    laps = list(frame_rate.drawn_laps(opened, ctx, lambda: float(next(now))))
    assert len(laps) == sum(len(frames) - 1 for frames in frames_of(opened).values())
    assert {(lap.decode_s, lap.draw_s) for lap in laps} == {(1.0, 1.0)}
    assert min(lap.n_gaussians for lap in laps) > 0


def test_without_a_context_the_reason_is_said(project, monkeypatch):
    def none() -> None:
        raise ContextError("No driver.")

    monkeypatch.setattr(frame_rate, "_context", none)
    drawn = frame_rate.main(project)
    assert (drawn.laps, drawn.reason) == ([], "No driver.")


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs a context without a window")
def test_a_folder_without_a_project_is_said_too(ctx, tmp_path, monkeypatch):
    monkeypatch.setattr(frame_rate, "_context", lambda: ctx)
    monkeypatch.setattr(type(ctx), "release", lambda self: None)
    drawn = frame_rate.main(tmp_path)
    assert drawn.laps == []
    assert drawn.reason
