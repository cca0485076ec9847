"""The whole path with nothing faked: the sample, made small, trained by a worker process, measured, rendered, shown."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.applying.deletions import loaded
from app.cli.cli import main
from app.evaluation.evaluation import boundary_maps
from app.evaluation.headless import open_trained
from app.project.opening.project_access import open_project
from app.session.projects.project_commands import OpenProject
from app.session.projects.settings import Settings
from app.session.session import Session
from app.session.showing.look_commands import LookThrough, SetFrame
from engine.assets import asset_path
from engine.backends import table
from engine.backends.table import AUTO, BackendEntry, backend_called
from engine.capture.capture import open_capture
from engine.clip_files.clip_state import read_clip_state
from engine.parallel import n_cores
from tests.app.conftest import poll_until
from tests.built_once import BuiltOnce

SETTINGS = (
    "max_static_points=1500",
    "max_moving_points=800",
    "background_frames=6",
    "static_steps=12",
    "joint_steps=8",
    "source_steps=8",
)
SCALE = 0.25

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory, built_once: BuiltOnce) -> Path:
    """A project with clips 0 and 1 of the sample, trained for a few steps."""

    def train(folder: Path) -> None:
        arguments = ["train", str(asset_path("sample")), "--project", str(folder / "p"), "--scale", str(SCALE)]
        for assignment in SETTINGS:
            arguments += ["--set", assignment]
        assert main([*arguments, "--clips", "0:2", "--quiet"]) == 0

    folder = tmp_path_factory.mktemp("project")
    return built_once.copy("project", folder, train, sources=["app", "tests/app/test_real_training.py"]) / "p"


@pytest.mark.skipif(n_cores() < 2, reason="two workers need two cores")
def test_two_workers_train_the_clips_of_one_bit_for_bit(trained, tmp_path):
    found = {}
    for n_workers in (1, 2):  # on all cores one after the other, and on half of them at the same time
        folder = shutil.copytree(trained, tmp_path / str(n_workers))
        arguments = ["train", str(asset_path("sample")), "--project", str(folder), "--clips", "1:3", "--again"]
        assert main([*arguments, "--workers", str(n_workers), "--quiet"]) == 0
        logs = [(folder / "logs" / f"clip-{index:04d}.log").read_text() for index in (1, 2)]
        assert all(f"with {n_cores() // n_workers} threads" in log for log in logs)
        found[n_workers] = [read_clip_state(folder / "clips" / f"{index:04d}.safetensors") for index in (1, 2)]
    assert [clip.fingerprint for clip in found[1]] == [clip.fingerprint for clip in found[2]]
    assert found[1][0].fingerprint != found[1][1].fingerprint


def test_a_process_computes_everything_with_its_back_end(trained, tmp_path, monkeypatch):
    counting = BackendEntry("tests.engine.backends.counting.backend:CountingCpu", "counts")
    # without "cpu", for which nobody may ask
    monkeypatch.setattr(table, "BACKENDS", {"counting": counting, "reference": table.BACKENDS["reference"]})
    monkeypatch.setattr(table, "_chosen", AUTO)
    backend: Any = backend_called("counting")
    quiet = ["--backend", "counting", "--quiet"]
    assert (
        main(["eval", str(trained), "--clips", "1", "--metrics", "quick", "--json", str(tmp_path / "e.json"), *quiet])
        == 0
    )
    n_measured = dict(backend.n_calls)
    assert n_measured["decode"] >= 10
    assert n_measured["rasterize"] >= 10
    assert (
        main(
            ["render", str(trained), "--camera", "0", "--frames", "10:12", "--out", str(tmp_path / "pictures"), *quiet]
        )
        == 0
    )
    assert backend.n_calls["rasterize"] >= n_measured["rasterize"] + 2
    opened = open_trained(open_project(trained, is_writable=False))
    model = loaded(read_clip_state(opened.project.clip_path(1)), opened.reference).model
    assert model.backend is opened.load(1).model.backend is backend
    assert main(["eval", str(trained), "--json", str(tmp_path / "f.json"), "--backend", "cpu"]) == 2


def test_eval_has_one_row_per_clip_frame_and_camera(trained, tmp_path):
    out = tmp_path / "rows.json"
    assert main(["eval", str(trained), "--json", str(out), "--clips", "1", "--quiet"]) == 0
    document = json.loads(out.read_text())
    known = {"schema", "project", "capture", "scale", "holdout", "clips", "rows", "means"}  # of the first release
    assert set(document) == known | {"metrics", "precision", "columns", "seams"}
    assert (document["metrics"], document["precision"]) == ("all", "float")
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
    # nothing is dropped silently: every column of every row is there, gaps are counted with a reason
    for name, column in document["columns"].items():
        n_missing = sum(row[name] is None for row in document["rows"])
        assert (column["n_rows"], column["n_missing"]) == (len(document["rows"]) - n_missing, n_missing), name
        assert sum(column["why_missing"].values()) == n_missing
    assert document["columns"]["dssim1"]["n_missing"] == 0
    assert document["columns"]["dssim_ms"]["n_rows"] == 0  # 80 x 60 pictures are too small for five scales
    assert document["seams"]["boundaries"] == []  # one clip alone
    curve = document["means"]["frames"]
    assert curve["frame_index"] == list(range(10, 20))
    assert np.mean(curve["held_out"]["psnr"]) == pytest.approx(mean)
    worst = document["means"]["worst"]["held_out"]["psnr"][0]
    assert worst["psnr"] == min(row["psnr"] for row in held_out)


def test_eval_of_neighbouring_clips_measures_the_seam_between_them(trained, tmp_path, capsys):
    out = tmp_path / "rows.json"
    assert main(["eval", str(trained), "--json", str(out), "--metrics", "quick", "--precision", "8bit"]) == 0
    assert "Seam at frame 10: score" in capsys.readouterr().err
    document = json.loads(out.read_text())
    assert document["precision"] == "8bit"
    assert "quick" in next(iter(document["columns"]["flip"]["why_missing"]))
    seams, names = document["seams"], open_capture(asset_path("sample")).rig.names
    pairs = [(pair["clip_index"], pair["camera"], pair["frame_index"]) for pair in seams["rows"]]
    assert pairs == [(c, name, f) for c in (0, 1) for name in names for f in range(10 * c, 10 * c + 10) if f > 0]
    (boundary,) = seams["boundaries"]
    assert (boundary["frame_index"], boundary["clips"]) == (10, [0, 1])
    assert set(boundary["cameras"]) == set(names)
    assert boundary["ratio_static"] > 0
    opened = open_trained(open_project(trained, is_writable=False))
    maps = boundary_maps(opened, clip_index=1, camera_index=3)
    row = next(pair for pair in seams["rows"] if pair["is_boundary"] and pair["camera"] == names[3])
    assert maps.change[maps.is_static].mean() == pytest.approx(row["change_static"], abs=1 / 255)  # not rounded here
    assert maps.is_static.mean() == row["static_share"]
    with pytest.raises(ValueError, match="no clip before"):
        boundary_maps(opened, clip_index=0, camera_index=3)


def test_render_shows_features_apart(trained, tmp_path):
    pictures = {}
    for features in ("both", "static", "dynamic"):
        arguments = ["render", str(trained), "--camera", "cam03", "--frames", "12", "--features", features, "--quiet"]
        assert main([*arguments, "--out", str(tmp_path / features)]) == 0
        pictures[features] = (tmp_path / features / "frame_000012.png").read_bytes()
    assert len(set(pictures.values())) == 3


def test_render_follows_the_camera_across_clips(trained, tmp_path):
    arguments = ["render", str(trained), "--camera", "cam03", "--frames", "8:12", "--quiet"]
    assert main([*arguments, "--out", str(tmp_path / "v.mp4")]) == 0
    assert (tmp_path / "v.mp4").stat().st_size > 500
    assert main([*arguments, "--out", str(tmp_path / "frames")]) == 0
    assert sorted(path.name for path in (tmp_path / "frames").iterdir()) == [f"frame_{i:06d}.png" for i in range(8, 12)]


def test_the_session_shows_what_was_trained(trained, tmp_path):
    session = Session(settings=Settings(tmp_path / "settings.json"), is_preloading=False)
    try:
        session.dispatch(OpenProject(trained))
        poll_until(session, lambda: session.capture is not None)
        assert [state.state for state in session.clip_states] == ["trained", "trained", "untrained"]
        session.dispatch(SetFrame(13))
        poll_until(session, lambda: _shows(session, 13))
        gaussians, anchors = session.shown_gaussians(), session.shown_anchors()
        assert gaussians is not None
        assert anchors is not None
        assert session.capture is not None
        assert np.isfinite(gaussians.means).all()
        assert len(anchors.inherited_positions) == len(np.unique(anchors.inherited_positions, axis=0)) > 0
        session.dispatch(LookThrough(0))
        poll_until(session, lambda: (p := session.request_render(80, 60)) is not None and not p.is_stale)
        shown = session.request_render(80, 60)
        assert shown is not None
        picture = shown.image
        truth = session.capture.frame(0, 13)
        assert picture.shape == truth.shape == (60, 80, 3)
        error = np.abs(picture.astype(float) - truth).mean()
        flipped = np.abs(picture[::-1].astype(float) - truth).mean()
        assert error < flipped  # the right way up, seen from the right place
        session.dispatch(SetFrame(25))  # clip 2 is not trained: the cloud
        assert session.shown_gaussians() is None
        poll_until(session, lambda: (p := session.shown_points()) is not None and not p.is_hint)
    finally:
        session.close()


def _shows(session: Session, frame_index: int) -> bool:
    shown = session.shown_gaussians()
    return shown is not None and shown.source.frame_index == frame_index
