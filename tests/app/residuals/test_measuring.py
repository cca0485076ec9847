"""Measuring as the window sees it: what is kept is there at once, the rest is asked for, and what is trained again is
forgotten."""

from __future__ import annotations

import json
import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest

from app.cli.cli import main
from app.residuals import measuring
from app.residuals.figures import PairFigures, RowFigures
from app.residuals.measuring_messages import LookAt, MeasureJob, MeasuringEnded, PictureMeasured, SetShare, Trouble
from app.residuals.measuring_order import MeasuringFocus
from app.residuals.measuring_process import KEPT, MeasuringProcess
from app.status import CELL_COLUMNS, ResidualStatus
from tests.app.residuals.conftest import DEADLINE_S, Opened, color, make_project
from tests.app.residuals.test_measuring_worker import job_of


class FakeMeasurer:
    """Says what a test puts into it."""

    def __init__(self, job: MeasureJob) -> None:
        self.job = job
        self.heard: list[object] = []
        self.events: list[object] = []
        self.is_ended = False

    def send(self, command) -> None:
        self.heard.append(command)

    def poll(self):
        events, self.events = self.events, []
        return events

    def end(self) -> None:
        self.is_ended = True


class Clock:
    """Passes when a test says so."""

    now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


class Launched:
    """Every measurer that was started."""

    def __init__(self) -> None:
        self.all: list[FakeMeasurer] = []

    def __call__(self, job: MeasureJob) -> FakeMeasurer:
        self.all.append(FakeMeasurer(job))
        return self.all[-1]


@pytest.fixture(autouse=True)
def at_once(monkeypatch):
    monkeypatch.setattr(measuring, "START_AFTER_S", 0.0)
    monkeypatch.setattr(measuring, "STATUS_EVERY_S", 0.0)


@pytest.fixture
def launched() -> Launched:
    return Launched()


def poll(opened: Opened, n_times: int = 3, *, is_busy: bool = False) -> ResidualStatus:
    for _ in range(n_times):
        opened.residuals.poll(is_busy=is_busy)
    return opened.residuals.status


def poll_until(opened: Opened, is_right) -> ResidualStatus:
    until_s = time.monotonic() + DEADLINE_S
    while not is_right(status := poll(opened, 1)):
        assert time.monotonic() < until_s, status
        time.sleep(0.001)
    return status


def evaluate(project: Path, *arguments: str) -> dict:
    out = project.parent / "out.json"
    assert main(["eval", str(project), "--json", str(out), "--quiet", *arguments]) == 0
    return json.loads(out.read_text())


def test_nothing_is_measured_before_somebody_looks(open_residuals, launched):
    opened = open_residuals(launch=launched)
    status = poll(opened)
    assert launched.all == []
    assert (status.n_done, status.n_all) == (0, 24)
    assert [(seam.clip_index, seam.frame_index, seam.score) for seam in status.seams] == [(1, 3, None)]
    assert status.is_held_out == tuple(name == "0" for name in opened.opened.rig.names)
    opened.timeline.seek(4)
    opened.residuals.look_at(opened.timeline, 2)
    assert poll(opened).is_measuring
    (measurer,) = launched.all
    assert measurer.job.look == MeasuringFocus(1, 2)
    assert measurer.job.trained == (0, 1)
    assert measurer.job.is_kept
    assert measurer.job.rows.all()
    assert measurer.job.pairs.sum() == 20
    opened.timeline.seek(0)
    opened.residuals.look_at(opened.timeline, None)
    poll(opened)
    assert measurer.heard == [LookAt(MeasuringFocus(0, None))]


def test_what_is_measured_shows_and_what_goes_wrong_is_told(open_residuals, launched):
    opened = open_residuals(launch=launched)
    opened.residuals.look_at(opened.timeline, None)
    poll(opened)
    (measurer,) = launched.all
    measurer.events = [
        PictureMeasured(1, row=RowFigures(3, 2, 31.5, 0.125)),
        PictureMeasured(1, pair=PairFigures(3, 2, 2 / 255, 1 / 255, 0.5)),
        PictureMeasured(1, row=RowFigures(4, 2, 29.5, None)),
        Trouble("The disk is odd."),
        Trouble("The disk is odd."),
    ]
    status = poll(opened)
    assert status.cells["psnr"][3, 2] == 31.5
    assert status.cells["flip"][3, 2] == 0.125
    assert status.cells["E"][3, 2] == pytest.approx(2.0)
    assert np.isnan(status.cells["flip"][4, 2])
    assert status.worst("psnr", 5) == [(29.5, 4, 2), (31.5, 3, 2)]
    assert status.worst("flip", 1) == [(0.125, 3, 2)]
    assert (status.n_done, status.message) == (1, "The disk is odd.")  # of frame 4 the pair is missing
    with pytest.raises(ValueError, match="read-only"):
        status.cells["psnr"][0, 0] = 1.0
    measurer.events = [MeasuringEnded()]
    status = poll(opened)
    assert not status.is_measuring
    assert status.n_done == 1
    assert len(launched.all) == 1, "what could not be measured is not tried again and again"


def test_a_seam_is_provisional_and_a_clip_without_its_figure_until_all_cameras_are_in(open_residuals, launched):
    opened = open_residuals(launch=launched)
    opened.residuals.look_at(opened.timeline, None)
    poll(opened)
    (measurer,) = launched.all
    held_out = opened.opened.holdout[0]
    for camera in (held_out, *({0, 1, 2, 3} - {held_out})):
        for frame in range(6):
            measurer.events.append(PictureMeasured(frame // 3, row=RowFigures(frame, camera, 30.0 + frame, 0.1)))
            if frame:
                pair = PairFigures(frame, camera, 0.01, 0.004 if frame == 3 else 0.002, 0.02 if frame == 3 else 0.01)
                measurer.events.append(PictureMeasured(frame // 3, pair=pair))
        *most, last = measurer.events
        measurer.events = most
        status = poll(opened)
        (seam,) = status.seams
        assert seam.ratio == pytest.approx(2.0)
        assert seam.is_provisional, "a pair inside of the later clip is missing"
        if camera == held_out:
            assert status.measured == {"psnr": (6, 24), "flip": (6, 24), "E": (4, 20)}
            records = [opened.catalog[index] for index in range(2)]
            assert [(record.held_out_psnr, record.held_out_whole) for record in records] == [(31.0, True), (34.0, True)]
        measurer.events = [last]
        poll(opened)
    (seam,) = opened.residuals.status.seams
    assert (seam.n_cameras, seam.n_all, seam.is_provisional) == (4, 4, False)


def test_a_forecast_waits_until_it_is_known_and_does_not_follow_a_camera_that_begins_slowly(open_residuals, launched):
    clock = Clock()
    opened = open_residuals(launch=launched, clock=clock)
    opened.residuals.look_at(opened.timeline, None)
    poll(opened)
    (measurer,) = launched.all
    told = []
    for frame, seconds in ((0, 30.0), (1, 10.0), (2, 30.0), (3, 10.0), (4, 30.0), (5, 10.0)):
        clock.now_s += seconds
        measurer.events = [PictureMeasured(frame // 3, row=RowFigures(frame, 2, 30.0, 0.1))]
        measurer.events += [PictureMeasured(frame // 3, pair=PairFigures(frame, 2, 0.01, 0.002, 0.01))] if frame else []
        status = poll(opened)
        told.append(status.eta_s)
    assert told[:2] == [None, None]
    per_picture = [eta / (24 - done) for eta, done in zip(told[2:], (3, 4, 5, 6), strict=True)]
    assert max(per_picture) < 1.35 * min(per_picture)


def test_while_a_clip_trains_it_is_held_back_where_training_has_every_core(open_residuals, launched, monkeypatch):
    opened = open_residuals(launch=launched)
    opened.residuals.look_at(opened.timeline, None)
    monkeypatch.setattr(measuring, "n_cores", lambda: 2)
    assert not poll(opened).is_held_back
    assert poll(opened, is_busy=True).is_held_back
    assert not poll(opened).is_held_back
    assert launched.all[0].heard == [SetShare(measuring.SHARE_WHILE_BUSY), SetShare(1.0)]
    monkeypatch.setattr(measuring, "n_cores", lambda: 8)
    assert not poll(opened, is_busy=True).is_held_back


@pytest.mark.slow
def test_kept_figures_are_there_without_measuring(open_residuals, launched, project):
    document = evaluate(project)
    opened = open_residuals(launch=launched)
    opened.residuals.look_at(opened.timeline, None)
    status = poll_until(opened, lambda status: status.n_done == 24 and status.seams[0].score is not None)
    names = opened.opened.rig.names
    for row in document["rows"]:
        assert status.cells["psnr"][row["frame_index"], names.index(row["camera"])] == np.float32(row["psnr"])
    assert status.seams[0].score == pytest.approx(document["seams"]["boundaries"][0]["score"], abs=1e-12)
    poll(opened)
    assert launched.all == []
    assert status.message == ""


def test_while_others_measure_their_figures_are_read_and_nothing_is_measured_here(open_residuals, launched, project):
    clock = Clock()
    opened = open_residuals(launch=launched, clock=clock)
    opened.residuals.look_at(opened.timeline, None)
    assert poll(opened).is_measuring
    evaluate(project, "--clips", "0")
    with (project / "evaluations" / "0000-all-float.jsonl").open("ab") as file:
        file.write(b'{"half a li')  # being written just now
    clock.now_s += measuring.READ_AGAIN_S
    status = poll_until(opened, lambda status: status.n_done == 12)
    assert (status.is_measuring, status.message) == (False, "")
    assert launched.all[0].is_ended
    assert not poll(opened).is_measuring, "more may come"
    clock.now_s += measuring.READ_AGAIN_S
    poll_until(opened, lambda status: status.is_measuring)
    assert not launched.all[1].job.rows[:3].any()
    assert launched.all[1].job.rows[3:].all()
    evaluate(project)
    clock.now_s += measuring.READ_AGAIN_S
    status = poll_until(opened, lambda status: status.n_done == 24)
    assert launched.all[1].is_ended
    for _ in range(3):
        clock.now_s += measuring.READ_AGAIN_S
        assert not poll(opened).is_measuring
    assert len(launched.all) == 2


@pytest.mark.slow
@pytest.mark.parametrize("metrics", ["all", "quick"])
def test_the_held_out_psnr_of_a_clip_is_the_evaluations_everywhere(open_residuals, launched, project, capsys, metrics):
    few = 20.0
    (project / "metrics").mkdir(exist_ok=True)
    (project / "metrics" / "0000.jsonl").write_text(json.dumps({"step": 3, "held_out_psnr": few}) + "\n")
    assert main(["clips", str(project), "--json"]) == 0
    clip = json.loads(capsys.readouterr().out)["clips"][0]
    assert (clip["held_out_psnr"], clip["held_out_whole"]) == (few, False)
    assert main(["clips", str(project)]) == 0
    assert "held-out PSNR ~20.00 dB, few pictures" in capsys.readouterr().out
    means = evaluate(project, "--metrics", metrics)["means"]["clips"]
    expected = [means[str(index)]["held_out"]["psnr"] for index in range(2)]
    assert abs(expected[0] - few) > 0.1
    assert main(["clips", str(project), "--json"]) == 0
    clips = json.loads(capsys.readouterr().out)["clips"]
    assert [clip["held_out_psnr"] for clip in clips] == expected
    assert all(clip["held_out_whole"] for clip in clips)
    assert main(["train", str(project.parent / "ring"), "--project", str(project), "--json", "--quiet"]) == 0
    outcomes = json.loads(capsys.readouterr().out)["clips"]
    assert [clip["held_out_psnr"] for clip in outcomes] == expected
    opened = open_residuals(launch=launched)
    poll_until(opened, lambda status: status.measured["psnr"] == (24, 24))
    records = [opened.catalog[index] for index in range(2)]
    assert [record.held_out_psnr for record in records] == expected
    assert all(record.held_out_whole for record in records)
    reference = opened.project.headers.read(project / "clips" / "0000.safetensors").header.fingerprint
    color(project / "clips" / "0001.safetensors", seed=5, reference=reference)
    opened.catalog.update(1)
    assert not opened.catalog[1].held_out_whole, "it was trained again"


def test_quick_figures_are_shown_and_flip_is_measured(open_residuals, launched, project):
    evaluate(project, "--metrics", "quick")
    opened = open_residuals(launch=launched)
    opened.residuals.look_at(opened.timeline, None)
    status = poll_until(opened, lambda status: status.is_measuring)
    assert np.isfinite(status.cells["psnr"]).all()
    assert np.isnan(status.cells["flip"]).all()
    assert launched.all[0].job.rows.all()
    assert not launched.all[0].job.pairs.any()


@pytest.mark.slow
@pytest.mark.parametrize("damage", [b"{", b"\xff\xfe\x00", b"[" * 5000])
def test_damaged_figures_are_told_once_and_measured_again(open_residuals, launched, project, damage):
    evaluate(project)
    path = project / "evaluations" / "0000-all-float.jsonl"
    path.write_bytes(damage + b"\n" + path.read_bytes().split(b"\n", 1)[1])
    opened = open_residuals(launch=launched)
    opened.residuals.look_at(opened.timeline, None)
    status = poll_until(opened, lambda status: status.is_measuring)
    assert status.message.count("damaged and are measured again") == 1
    assert launched.all[0].job.rows[:3].all()
    assert not launched.all[0].job.rows[3:].any()
    assert np.isfinite(status.cells["psnr"][3:]).all()


def test_a_clip_that_is_trained_again_is_forgotten_at_once_and_its_neighbours_boundary(
    open_residuals, launched, project
):
    evaluate(project)
    opened = open_residuals(launch=launched)
    opened.residuals.look_at(opened.timeline, None)
    poll_until(opened, lambda status: status.n_done == 24)
    header = opened.project.headers.read(project / "clips" / "0000.safetensors")
    color(project / "clips" / "0001.safetensors", seed=3, reference=header.header.fingerprint)
    opened.catalog.update(1)
    status = poll(opened, 1)
    for column in CELL_COLUMNS:
        assert np.isnan(status.cells[column][3:]).all()
        assert np.isfinite(status.cells[column][1:3]).all()
    assert status.seams[0].score is None
    poll_until(opened, lambda status: status.is_measuring)
    job = launched.all[0].job
    assert not job.rows[:3].any()
    assert job.rows[3:].all()
    color(project / "clips" / "0001.safetensors", seed=4, reference=header.header.fingerprint)
    opened.catalog.update(1)
    poll(opened, 1)
    assert launched.all[0].is_ended, "figures of the old version must not be taken for those of the new one"
    poll_until(opened, lambda status: status.is_measuring)
    assert len(launched.all) == 2


def test_where_one_field_is_for_all_clips_a_new_one_makes_all_figures_old(tmp_path, launched):
    project = make_project(tmp_path, field="continue")
    evaluate(project)
    opened = Opened(project, launch=launched)
    poll_until(opened, lambda status: status.n_done == 24)
    header = opened.project.headers.read(project / "clips" / "0000.safetensors")
    assert header is not None
    assert header.header is not None
    color(project / "clips" / "0001.safetensors", seed=3, reference=header.header.fingerprint)
    opened.catalog.update(1)
    status = poll(opened, 1)
    assert not any(np.isfinite(status.cells[column]).any() for column in CELL_COLUMNS)
    opened.close()


def test_when_the_reference_is_trained_again_everything_is_forgotten(open_residuals, launched, project):
    evaluate(project)
    opened = open_residuals(launch=launched)
    poll_until(opened, lambda status: status.n_done == 24)
    color(project / "clips" / "0000.safetensors", seed=9)
    opened.catalog.update(0)
    status = poll(opened, 1)
    assert status.n_all == 12, "the other clip is out of date"
    assert not any(np.isfinite(status.cells[column]).any() for column in CELL_COLUMNS)


def test_a_project_opened_read_only_is_measured_in_memory(project, launched):
    opened = Opened(project, is_writable=False, launch=launched)
    opened.residuals.look_at(opened.timeline, None)
    poll(opened)
    assert not launched.all[0].job.is_kept
    opened.close()
    assert launched.all[0].is_ended


def test_another_project_ends_what_is_measured(open_residuals, launched):
    opened = open_residuals(launch=launched)
    opened.residuals.look_at(opened.timeline, None)
    poll(opened)
    opened.residuals.open(opened.opened, opened.catalog)
    assert launched.all[0].is_ended
    poll(opened)
    assert len(launched.all) == 1, "nobody has looked yet"


@pytest.mark.slow
def test_in_a_process_of_its_own(open_residuals, project):
    opened = open_residuals()
    opened.residuals.look_at(opened.timeline, None)
    status = poll_until(opened, lambda status: status.n_done == 24)
    status = poll_until(opened, lambda status: not status.is_measuring)
    assert status.message == ""
    assert status.seams[0].score is not None
    document = evaluate(project)
    names = opened.opened.rig.names
    for row in document["rows"]:
        assert status.cells["flip"][row["frame_index"], names.index(row["camera"])] == np.float32(row["flip"])


@pytest.mark.slow
def test_a_process_that_is_killed_is_told_once_and_nothing_is_lost(open_residuals, project):
    made: list[MeasuringProcess] = []

    def launch(job: MeasureJob) -> MeasuringProcess:
        made.append(MeasuringProcess(job))
        return made[-1]

    opened = open_residuals(launch=launch)
    opened.residuals.look_at(opened.timeline, None)
    poll_until(opened, lambda status: status.is_measuring)
    pid = made[0].child.pid
    assert pid is not None
    os.kill(pid, signal.SIGKILL)
    status = poll_until(opened, lambda status: not status.is_measuring)
    died = f"The process that measures was ended by signal 9, perhaps because memory ran out. {KEPT}"
    assert status.message == died
    poll(opened, 5)
    assert len(made) == 1
    assert opened.residuals.status.message == died


@pytest.mark.slow
def test_a_capture_that_disappears_is_told(open_residuals, project):
    opened = open_residuals()
    (project.parent / "ring").rename(project.parent / "gone")
    opened.residuals.look_at(opened.timeline, None)
    poll_until(opened, lambda status: status.is_measuring)
    status = poll_until(opened, lambda status: not status.is_measuring)
    assert "ring" in status.message
    assert status.n_done == 0


def test_a_process_that_cannot_be_started_is_told(project, monkeypatch):
    def refuse(*_, **__) -> None:
        raise OSError(12, "Cannot allocate memory")

    monkeypatch.setattr("engine.children.process.subprocess.Popen", refuse)
    process = MeasuringProcess(job_of(project))
    reason = f"The process that measures could not be started (Cannot allocate memory). {KEPT}"
    assert process.poll() == [Trouble(reason), MeasuringEnded()]
    process.end()
