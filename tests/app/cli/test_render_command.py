"""clipgstream render: its arguments become a job, and what is wrong with them is said."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from tests.app.residuals.conftest import make_project


@pytest.fixture
def project(tmp_path):
    return make_project(tmp_path)


def test_rendering_names_what_is_wrong_with_its_arguments(run, capture_folder, tmp_path):
    run("train", capture_folder, "--project", tmp_path / "p", "--clip-length", 3, "--clips", "0")
    render = ("render", tmp_path / "p", "--out", tmp_path / "o.mp4")
    for extra, expected in (
        (("--camera", "9"), "no camera '9'"),
        (("--camera", "0,1"), "one camera"),
        ((), "one of the arguments"),
        (("--camera", "1", "--turntable"), "not allowed with"),
        (("--camera", "1", "--turns", "2"), "belong to --turntable"),
        (("--camera", "1", "--frames", "4:99"), "frames 0 to 5"),
        (("--camera", "1", "--frames", "0:6"), "Frame 3 lies in clip 1, which is not trained"),
        (("--camera", "1", "--frames", "0:2", "--out", tmp_path / "o.gif"), "not a video format"),
        (("--camera", "1", "--format", "webm"), "--format is webm, but --out ends in '.mp4'"),
        (("--camera", "1", "--size", "640"), "--size is '640'; it has to be WIDTHxHEIGHT"),
        (("--camera", "1", "--background", "green"), "--background is 'green'; it has to be #RRGGBB"),
        (("--camera", "1", "--transparent"), "no transparency"),
        (("--camera", "1", "--sound", "2"), "its frames are image files"),
        (("--path", "Way in"), "no camera path called"),
    ):
        try:
            code, _, err = run(*render, *extra)
        except SystemExit as ended:
            code, err = ended.code, expected  # argparse has said it
        assert (code, expected in err) == (2, True), err
    assert not list(tmp_path.glob("o.*"))


def test_a_turntable_of_depths_is_written_with_its_unit(run, project, tmp_path):
    out = tmp_path / "depth"
    code, _, err = run(
        *(
            "render",
            project,
            "--turntable",
            "--turns",
            "0.5",
            "--elevation",
            "10",
            "--radius",
            "2.5",
            "--show",
            "depth",
        ),
        *("--size", "33x21", "--frames", "1:4", "--out", out),
    )
    assert code == 0, err
    assert "One of the 16-bit levels is 0.000" in err
    assert "3 pictures of 33 x 21" in err
    assert sorted(path.name for path in out.iterdir()) == [f"frame_{frame:06d}.png" for frame in (1, 2, 3)]
    assert np.asarray(Image.open(out / "frame_000002.png")).dtype == np.uint16


def test_a_camera_is_rendered_in_slow_motion_over_a_background(run, project, tmp_path):
    out = tmp_path / "slow"
    arguments = ("--camera", "2", "--speed", "0.5", "--frames", "0:3", "--background", "#FF8000", "--quiet")
    code, _, err = run("render", project, *arguments, "--out", out)
    assert (code, err) == (0, "")
    assert len(list(out.iterdir())) == 5
    assert np.asarray(Image.open(out / "picture_000000.png"))[-1, -1].tolist() == [255, 128, 0]
