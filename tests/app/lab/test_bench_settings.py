"""Settings in the benchmark: rows of trainings and exports, their panels, and captures that cannot be measured."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from PIL import Image

from app.cli.cli import main
from app.evaluation.headless import open_trained
from app.lab.bench import suite
from app.lab.bench.chart import draw_speed_error
from app.lab.bench.command import CHART_FILE, TRAINED
from app.lab.bench.rows import DEFAULTS, SpeedError, Trade
from app.lab.bench.settings import exports
from app.lab.bench.settings.exports import KINDS, measure_exports
from app.lab.bench.settings.trainings import ShortTrainings
from app.lab.bench.suite import FULL, QUICK, Plan
from app.project.opening.project_access import open_project
from engine.capture.capture import open_capture
from engine.errors import DiskError, ProjectError
from tests.app.fakes import write_capture
from tests.app.lab.ablation.runs import Runner
from tests.app.residuals.conftest import make_project

pytestmark = pytest.mark.slow


def trades() -> list[Trade]:
    rows = [("step", "tiles", "tiles=all", 0.02, 30.0), ("step", "tiles", DEFAULTS, 0.01, 30.0)]
    rows += [("clip", "quality", "quality=best", 90.0, 31.5), ("clip", "quality", DEFAULTS, 30.0, 31.0)]
    rows += [("export", name.split()[0], name, 0.1, 60.0) for name in KINDS]
    return [Trade(kind, line, setting, seconds, 500_000, psnr_db) for kind, line, setting, seconds, psnr_db in rows]


def test_every_format_is_written_read_and_measured(tmp_path):
    found = {trade.setting: trade for trade in measure_exports(open_trained(open_project(make_project(tmp_path))))}
    assert found.keys() == KINDS.keys()
    assert found["ply"].psnr_db > found["spz"].psnr_db > 30
    assert found["ply --fields full"].n_bytes > found["ply"].n_bytes > found["splat"].n_bytes
    assert found["ply --fields full"].line == found["ply"].line
    assert all(trade.seconds > 0 and trade.operation == "export" for trade in found.values())


def test_a_disk_that_refuses_is_named(tmp_path, monkeypatch):
    opened = open_trained(open_project(make_project(tmp_path)))
    monkeypatch.setattr(exports.tempfile, "tempdir", str(tmp_path / "none"))
    with pytest.raises(DiskError, match="No such file"):
        measure_exports(opened)


def test_each_setting_is_trained_once_and_set_against_the_defaults(tmp_path, capture_folder, monkeypatch):
    runner = Runner(tmp_path, open_capture(capture_folder), monkeypatch)
    said = []
    found, trained = ShortTrainings(runner.capture).measure(
        tmp_path, FULL.settings, launch=runner._launch, say=lambda what, done: said.append((what, done))
    )
    assert trained.trained == [0, 1]
    assert said[0] == ("training, full", 0.0)
    assert len(said) == 1 + sum(map(len, FULL.settings.values()))
    for operation, row in FULL.settings.items():
        marks = [trade for trade in found if trade.operation == operation]
        assert [trade.setting for trade in marks if trade.setting != DEFAULTS] == list(row)
        lines = {trade.line for trade in marks}
        assert {trade.line for trade in marks if trade.setting == DEFAULTS} == lines
    assert ("tiles.all-seed0", 0) not in runner.launched, "its reference clip is that of the defaults"
    assert {trade.psnr_db for trade in found if trade.operation == "clip"} == {22.0}  # the runner's, over two clips
    one, both = (next(t for t in found if (t.operation, t.setting) == (kind, DEFAULTS)) for kind in FULL.settings)
    assert one.n_bytes < both.n_bytes
    assert one.psnr_db == 20.0


@pytest.mark.parametrize(("n_frames", "holdout", "expected"), [(5, ("0",), "5 frames"), (6, (), "0 held-out cameras")])
def test_captures_without_a_later_clip_or_a_held_out_camera_are_refused(tmp_path, n_frames, holdout, expected):
    capture = replace(open_capture(write_capture(tmp_path / "c", n_frames=n_frames)), default_holdout=holdout)
    with pytest.raises(ProjectError, match=expected):
        ShortTrainings(capture)


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [(("--capture", "none"), "none"), (("--capture", "CAPTURE", "--scale", "0"), "scale")],
)
def test_bad_captures_end_with_2_before_anything_is_measured(
    monkeypatch, capture_folder, tmp_path, capsys, arguments, expected
):
    monkeypatch.setattr(suite, "run_plan", lambda *a, **k: pytest.fail("measured all the same"))
    monkeypatch.chdir(tmp_path)
    assert main(["bench", *(str(capture_folder) if word == "CAPTURE" else word for word in arguments)]) == 2
    assert expected in capsys.readouterr().err


def test_the_command_shows_settings_and_exports_everywhere(monkeypatch, capture_folder, tmp_path, capsys):
    asked = []
    rows = trades()
    monkeypatch.setattr(suite, "QUICK", Plan(settings=QUICK.settings))
    monkeypatch.setattr("app.background.kernels.warm_cache", lambda: None)
    monkeypatch.setattr("app.lab.bench.fma_limit._ROUNDS_PER_CALL", 100)
    monkeypatch.setattr(ShortTrainings, "measure", lambda *a, **k: (asked.append(a), (rows[:4], "trained"))[1])
    monkeypatch.setattr(exports, "measure_exports", lambda trained: (asked.append(trained), rows[4:])[1])
    out = tmp_path / "out"
    assert main(["bench", "--capture", str(capture_folder), "--out", str(out), "--json", str(tmp_path / "b.json")]) == 0
    assert [asked[0][0]._capture.scale, *asked[0][1:], *asked[1:]] == [0.5, out / TRAINED, QUICK.settings, "trained"]
    said = capsys.readouterr().out
    assert "clip, quality=best" in said
    assert "export, ply --fields full" in said
    written = json.loads((tmp_path / "b.json").read_text())["settings"]
    assert [row["setting"] for row in written] == [trade.setting for trade in rows]
    assert (out / CHART_FILE).is_file()


def test_the_picture_has_a_row_for_each_of_the_five_operations(tmp_path):
    marks = [SpeedError(kind, "s", "n", "cpu", 2.0, 1e-6, 1e-6) for kind in ("raster", "decode", "step")]
    for name, some in (("kernels", []), ("all", trades())):
        draw_speed_error(marks, tmp_path / f"{name}.png", footer="a machine", trades=some)
    draw_speed_error([], tmp_path / "settings.png", footer="a machine", trades=trades())
    heights = {}
    for path in tmp_path.glob("*.png"):
        with Image.open(path) as image:
            heights[path.stem] = image.size[1]
    assert heights["all"] > heights["kernels"] + 1000
    assert heights["settings"] > 1000
