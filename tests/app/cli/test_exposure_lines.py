"""What `clipgstream inspect` says of the cameras' exposure."""

import json
import re

import numpy as np
import pytest
from PIL import Image

from app.cli.captures.exposure_lines import curve_signs, exposure_document, exposure_lines
from engine.cloud.background.exposure_survey import ExposureCurve, ExposureSurvey
from tests.app.fakes import write_capture

FRAMES = (0, 10, 20, 30, 40)


def survey_of(unreadable=None, n_cameras=None, *, is_late=False, **levels) -> ExposureSurvey:
    curves = {
        name: ExposureCurve(FRAMES, (1.0 + np.array(values))[:, None] * np.ones(3)) for name, values in levels.items()
    }
    unreadable = unreadable or {}
    return ExposureSurvey(FRAMES, curves, n_cameras or len(curves) + len(unreadable), unreadable, is_late)


def test_a_line_per_camera_that_changes_and_one_for_the_others():
    lines = exposure_lines(
        survey_of(a=[0, 0.03, 0.06, 0.09, 0.12], b=[0, 0.001, 0, 0, 0], c=[0, 0, -0.05, -0.05, -0.05], d=[0] * 5)
    )
    assert "".join(lines).isascii()
    text = "\n".join(lines)
    assert "_.-''   +0.0 to +12.0 %" in text
    assert "''___   -5.0 to  +0.0 %, step of -5.0 % between frames 10 and 20" in text


def test_a_calm_capture_takes_one_line():
    assert len(exposure_lines(survey_of(a=[0] * 5, b=[0, 0.002, 0, 0, 0]))) == 1


def test_what_was_not_looked_at_is_said():
    late = exposure_lines(survey_of({"x": "It is gone."}, 9, is_late=True, a=[0] * 5))
    assert late[0] == "Note: camera x could not be checked: It is gone."
    assert "1 of 9 cameras: more would take longer than 20 s" in late[1]
    assert "there are too many" in exposure_lines(survey_of(n_cameras=900, a=[0] * 5))[0]
    assert exposure_document(survey_of(n_cameras=900, a=[0] * 5))["is_complete"] is False


def test_the_curve_spans_its_signs():
    assert curve_signs(np.array([0.0, 1.0, 2.0, 3.0])) == "_.-'"
    assert curve_signs(np.zeros(3)) == "___"


@pytest.mark.slow
def test_inspecting_measures_the_pictures_of_a_capture(run, tmp_path):
    folder = write_capture(tmp_path / "ring", size=(64, 48))
    wall = np.random.default_rng(0).integers(60, 160, (6, 8, 3)).repeat(8, 0).repeat(8, 1)
    for i, path in enumerate(sorted((folder / "ims" / "1").iterdir())):
        Image.fromarray((wall * (1.0 if i < 3 else 0.9) + 0.5).astype(np.uint8)).save(path, quality=95)
    code, out, err = run("inspect", folder)
    assert code == 0
    first, *others = err.splitlines()
    assert first.startswith("The doctor uses up to about ")
    assert all(line.startswith("Capture doctor ") for line in others)  # progress
    assert re.search(r"step of -(9\.[5-9]|10\.[0-5]) % between frames 2 and 3 \(auto exposure\)", out)
    found = json.loads(run("inspect", folder, "--json")[1])["exposure"]
    assert found["frames"] == list(range(6))
    assert (found["n_measured"], found["is_complete"], found["unreadable"]) == (4, True, {})
    camera = next(camera for camera in found["cameras"] if camera["name"] == "1")
    assert np.allclose(camera["gains"], [[1.0] * 3] * 3 + [[0.9] * 3] * 3, atol=0.005)
    assert [(step["before"], step["after"]) for step in camera["steps"]] == [(2, 3)]
