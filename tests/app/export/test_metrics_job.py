"""Figures as tables: every picture has a row, and what was not measured says so."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import msgspec
import pytest

from app.evaluation.evaluation import evaluate_project
from app.evaluation.headless import TrainedProject
from app.export.export_progress import ExportProgress
from app.export.metrics_job import NOT_MEASURED, MetricsJob, estimate, run
from app.export.picked_frames import PickedFrames
from engine.children.kind import Unwanted
from engine.errors import DiskError, ProjectError
from engine.training.config import TrainConfig
from tests.app.lab.report.made_up import Measure


def nothing(progress: ExportProgress) -> None:
    """For who does not look."""


def measure(opened: TrainedProject, clip_indices: list[int], metrics: str = "all") -> dict:
    """Made-up figures, kept in the project as `eval` keeps them."""
    return evaluate_project(
        opened,
        clip_indices=clip_indices,
        metrics=metrics,  # type: ignore[arg-type]
        on_progress=lambda *_: None,
        measuring=Measure(),
    )


def read(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_the_table_has_every_picture_with_its_figures_and_settings(opened: TrainedProject, tmp_path: Path):
    known = measure(opened, [0])
    told: list[ExportProgress] = []
    result = run(opened, MetricsJob(tmp_path / "out" / "m.csv"), told.append)
    rows = read(result.path)
    assert [(row["clip_index"], row["frame_index"], row["camera"]) for row in rows] == [
        (str(frame // 3), str(frame), camera) for frame in range(6) for camera in ("0", "1", "2", "3")
    ]
    by_place = {(row["frame_index"], row["camera"]): row for row in known["rows"]}
    for row in rows[:12]:
        kept = by_place[int(row["frame_index"]), row["camera"]]
        assert float(row["psnr"]) == kept["psnr"]
        assert row["is_held_out"] == str(kept["is_held_out"])
        assert (row["metrics"], row["precision"], row["scale"]) == ("all", "float", "1.0")
        assert row["dssim_ms"] == ""
        assert "dssim_ms" in row["missing"]
        assert "too small here" in row["missing"]
    for row in rows[12:]:
        assert (row["psnr"], row["metrics"], row["missing"]) == ("", "", NOT_MEASURED)
    assert rows[0]["steps"] == str(opened.header(0).step)
    assert rows[0]["clip"] == opened.header(0).fingerprint != rows[12]["clip"]
    assert [progress.n_done for progress in told] == [0, 1, 2]
    assert result.lines == ("12 of 24 pictures were not measured; `clipgstream eval` measures them.",)
    assert result.n_bytes == result.path.stat().st_size


def test_settings_that_differ_from_the_defaults_are_columns(opened: TrainedProject, tmp_path: Path, monkeypatch):
    from app.export.metrics_job import _Chosen

    monkeypatch.setattr(_Chosen, "settings", lambda self, index: {"joint_steps": 77} if index else {})
    rows = read(run(opened, MetricsJob(tmp_path / "m.csv"), nothing).path)
    assert [row["setting_joint_steps"] for row in rows] == ["0"] * 12 + ["77"] * 12


def test_the_better_choice_of_figures_counts(opened: TrainedProject, tmp_path: Path):
    measure(opened, [0, 1], "quick")
    known = measure(opened, [0])
    rows = read(run(opened, MetricsJob(tmp_path / "m.csv"), nothing).path)
    assert [row["metrics"] for row in rows] == ["all"] * 12 + ["quick"] * 12
    first = next(row for row in known["rows"] if (row["frame_index"], row["camera"]) == (0, "0"))
    assert float(rows[0]["psnr"]) == first["psnr"]


def test_json_has_clips_neighbours_and_all_settings(opened: TrainedProject, tmp_path: Path):
    known = measure(opened, [0, 1])
    result = run(opened, MetricsJob(tmp_path / "m.json", "json", PickedFrames.of(range(2, 6, 2))), nothing)
    found = json.loads(result.path.read_text())
    assert found["schema"] == 1
    assert found["cameras"] == ["0", "1", "2", "3"]
    assert found["untrained_clips"] == []
    assert found["settings"].keys() == {field.name for field in msgspec.structs.fields(TrainConfig)}
    assert found["columns"]["psnr"]["unit"] == "dB"
    pictures = [row for clip in found["clips"] for row in clip["pictures"]]
    assert {row["frame_index"] for row in pictures} == {2, 4}
    expected = {(row["frame_index"], row["camera"]): row["psnr"] for row in known["rows"]}
    assert all(row["psnr"] == expected[row["frame_index"], row["camera"]] for row in pictures)
    assert {pair["frame_index"] for clip in found["clips"] for pair in clip["neighbours"]} == {2, 4}
    assert [clip["fingerprint"] for clip in found["clips"]] == [opened.header(i).fingerprint for i in (0, 1)]


def test_untrained_clips_are_left_out_and_said(opened: TrainedProject, tmp_path: Path):
    opened.project.clip_path(1).unlink()
    assert estimate(opened, MetricsJob(tmp_path / "m.csv")).lines == ("1 clip is not trained and left out.",)
    assert len(read(run(opened, MetricsJob(tmp_path / "m.csv"), nothing).path)) == 12
    with pytest.raises(ProjectError, match="None of these frames is trained"):
        estimate(opened, MetricsJob(tmp_path / "m.csv", frames=PickedFrames.of(range(4, 6))))


def test_the_estimate_is_near_what_is_written(opened: TrainedProject, tmp_path: Path):
    measure(opened, [0, 1])
    for format_ in ("csv", "json"):
        job = MetricsJob(tmp_path / f"m.{format_}", format_)
        guess, result = estimate(opened, job), run(opened, job, nothing)
        assert guess.n_files == result.n_files == 1
        assert abs(math.log(guess.n_bytes / result.n_bytes)) < math.log(2.5)


def test_a_cancelled_export_leaves_nothing_and_what_was_there_stays(opened: TrainedProject, tmp_path: Path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "m.csv").write_text("before")

    def cancel(progress: ExportProgress) -> None:
        if progress.n_done == 1:
            raise Unwanted

    with pytest.raises(Unwanted):
        run(opened, MetricsJob(out / "m.csv"), cancel)
    assert [(path.name, path.read_text()) for path in out.iterdir()] == [("m.csv", "before")]


def test_a_full_disk_is_said_and_leaves_nothing(opened: TrainedProject, tmp_path: Path, monkeypatch):
    def refuse(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("app.export.metrics_job._write_csv", refuse)
    with pytest.raises(DiskError, match="No space left"):
        run(opened, MetricsJob(tmp_path / "out" / "m.csv"), nothing)
    assert list((tmp_path / "out").iterdir()) == []


def test_names_of_cameras_are_no_formulas(opened: TrainedProject, tmp_path: Path, monkeypatch):
    monkeypatch.setattr(type(opened.capture.rig), "names", ("=1+1", "1", "2", "3"))
    rows = read(run(opened, MetricsJob(tmp_path / "m.csv"), nothing).path)
    assert rows[0]["camera"] == "'=1+1"
