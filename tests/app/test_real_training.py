"""The whole path with nothing faked: the sample, made small, trained by a worker process, measured, rendered, shown."""

import json
from pathlib import Path

import numpy as np
import pytest

from app import commands as c
from app.cli import main
from app.session import Session
from app.settings import Settings
from engine.assets import asset_path
from engine.capture.capture import open_capture
from tests.app.conftest import poll_until

SETTINGS = (
    "max_static_points=1500",
    "max_moving_points=800",
    "background_frames=6",
    "static_steps=12",
    "joint_steps=8",
    "source_steps=8",
)
SCALE = 0.25


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project with clips 0 and 1 of the sample, trained for a few steps."""
    folder = tmp_path_factory.mktemp("project") / "p"
    arguments = ["train", str(asset_path("sample")), "--project", str(folder), "--scale", str(SCALE), "--clips", "0:2"]
    for assignment in SETTINGS:
        arguments += ["--set", assignment]
    assert main([*arguments, "--quiet"]) == 0
    return folder


@pytest.mark.slow
def test_eval_has_one_row_per_clip_frame_and_camera(trained, tmp_path):
    out = tmp_path / "rows.json"
    assert main(["eval", str(trained), "--json", str(out), "--clips", "1", "--quiet"]) == 0
    document = json.loads(out.read_text())
    assert set(document) == {"schema", "project", "capture", "scale", "holdout", "clips", "rows", "means"}
    assert document["clips"] == [1]
    capture = open_capture(asset_path("sample"))
    assert [(row["camera"], row["frame_index"]) for row in document["rows"]] == [
        (name, frame) for name in capture.rig.names for frame in range(10, 20)
    ]
    held_out = [row for row in document["rows"] if row["is_held_out"]]
    assert {row["camera"] for row in held_out} == set(document["holdout"]) == set(capture.default_holdout)
    mean = document["means"]["held_out"]["psnr"]
    assert mean == pytest.approx(np.mean([row["psnr"] for row in held_out]), rel=1e-9)
    assert document["means"]["clips"]["1"]["held_out"]["psnr"] == pytest.approx(mean)
    # a fit per channel that includes "no change" among its choices cannot be worse, up to the clamping of the picture
    assert all(row["psnr_fit"] >= row["psnr"] - 1e-6 for row in document["rows"])


@pytest.mark.slow
def test_render_follows_the_camera_across_clips(trained, tmp_path):
    arguments = ["render", str(trained), "--camera", "cam03", "--frames", "8:12", "--quiet"]
    assert main([*arguments, "--out", str(tmp_path / "v.mp4")]) == 0
    assert (tmp_path / "v.mp4").stat().st_size > 500
    assert main([*arguments, "--out", str(tmp_path / "frames")]) == 0
    assert sorted(path.name for path in (tmp_path / "frames").iterdir()) == [f"frame_{i:06d}.png" for i in range(8, 12)]


@pytest.mark.slow
def test_the_session_shows_what_was_trained(trained, tmp_path):
    session = Session(settings=Settings(tmp_path / "settings.json"), is_preloading=False)
    try:
        session.dispatch(c.OpenProject(trained))
        poll_until(session, lambda: session.capture is not None)
        assert [state.state for state in session.clip_states] == ["trained", "trained", "untrained"]
        session.dispatch(c.SetFrame(13))
        poll_until(session, lambda: _shows(session, 13))
        gaussians, anchors = session.shown_gaussians(), session.shown_anchors()
        assert gaussians is not None
        assert anchors is not None
        assert session.capture is not None
        assert np.isfinite(gaussians.means).all()
        assert len(anchors.inherited_positions) == len(np.unique(anchors.inherited_positions, axis=0)) > 0
        session.dispatch(c.LookThrough(0))
        poll_until(session, lambda: (p := session.request_render(80, 60)) is not None and not p.is_stale)
        shown = session.request_render(80, 60)
        assert shown is not None
        picture = shown.image
        truth = session.capture.frame(0, 13)
        assert picture.shape == truth.shape == (60, 80, 3)
        error = np.abs(picture.astype(float) - truth).mean()
        flipped = np.abs(picture[::-1].astype(float) - truth).mean()
        assert error < flipped  # the right way up, seen from the right place
        session.dispatch(c.SetFrame(25))  # clip 2 is not trained: the cloud
        assert session.shown_gaussians() is None
        poll_until(session, lambda: (p := session.shown_points()) is not None and not p.is_hint)
    finally:
        session.close()


def _shows(session: Session, frame_index: int) -> bool:
    shown = session.shown_gaussians()
    return shown is not None and shown.frame_index == frame_index
