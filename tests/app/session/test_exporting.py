"""Exports of a session: what is asked, what would be written, the queue, and what is remembered."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec
import pytest

from app.evaluation.headless import open_trained
from app.export.export_choices import ExportChoices, ExportContext
from app.export.export_plan import TAKEN, ExportPlan, plan_export
from app.export.export_progress import ExportResult
from app.export.jobs.answers import Answers
from app.export.jobs.table import KINDS
from app.export.queue.export_messages import ExportDone, ExportFailed
from app.playback.timeline import Timeline
from app.project.opening.opened_project import OpenedProject, opened_project
from app.project.opening.project_access import open_project
from app.project.project import Project
from app.scripting.scripted_project import open_scripted
from app.session.commands import CloseQuestion
from app.session.export_commands import AskExport, CancelExport, ShowExport
from app.session.exporting import Exporting, ExportPage
from app.session.notices import Notices
from app.session.projects.settings import Settings
from app.session.session import Session
from engine.capture.capture import open_capture
from engine.editing.edit import Sphere
from engine.errors import ProjectError
from tests.app.conftest import DEADLINE_S
from tests.app.export.test_export_choices import CONTEXT
from tests.app.export.test_export_queue import FakeExporter
from tests.app.fakes import write_capture
from tests.app.lab.report.made_up import train
from tests.app.residuals.conftest import make_project

METRICS = ExportChoices(kind="metrics", out="")


class Bench:
    """Exports of a made project with two clips of three frames; processes and file managers are made up."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.settings, self.notices = Settings(folder / "settings.json"), Notices()
        project = open_project(make_project(folder), is_writable=False)
        self.opened: OpenedProject = opened_project(open_capture(project.settings.capture), project, 1)
        self.timeline = Timeline(self.opened.clips)
        self.started: list[FakeExporter] = []
        self.shown: list[Path] = []
        self.is_training = False
        self.exporting = Exporting(
            self.notices, self.settings, launch=self._launch, show=self._show, is_training=lambda: self.is_training
        )
        self.exporting.open(self.opened)

    def _launch(self, task: object) -> FakeExporter:
        self.started.append(FakeExporter(task))  # type: ignore[arg-type]
        return self.started[-1]

    def _show(self, path: Path) -> None:
        self.shown.append(path)
        raise ProjectError("No file manager found.", path=path)

    def ask(self, trained: tuple[int, ...] = (0, 1)) -> None:
        self.exporting.ask(self.opened, self.timeline, trained)

    def plan(self, choices: ExportChoices) -> ExportPlan:
        """Wait for it, as the window does by asking at every frame."""
        found: list[ExportPlan] = []

        def look() -> bool:
            plan = self.exporting.plan(choices)
            found.extend([] if plan is None else [plan])
            return bool(found)

        self.until(look)
        return found[-1]

    def suggest(self, choices: ExportChoices) -> str:
        """Wait for it likewise."""
        found: list[str | None] = []

        def look() -> bool:
            found.append(self.exporting.suggest(choices))
            return found[-1] is not None

        self.until(look)
        assert found[-1] is not None
        return found[-1]

    def until(self, is_so: Callable[[], bool]) -> None:
        until_s = time.monotonic() + DEADLINE_S
        while not is_so():
            assert time.monotonic() < until_s
            self.exporting.poll()
            time.sleep(0.005)

    def start(self, out: str = "m.csv") -> None:
        self.ask()
        self.exporting.start(METRICS.changed(out=str(self.folder / "out" / out)))


def context_of(bench: Bench) -> ExportContext:
    """Of the dialog that is open."""
    assert bench.exporting.page is not None
    return bench.exporting.page.context


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    made = Bench(tmp_path)
    yield made
    made.exporting.close()


def test_what_has_ended_is_listed_with_its_project_alone(bench: Bench, tmp_path: Path):
    bench.start("first.csv")
    bench.exporting.cancel(bench.exporting.statuses[0].export_id)
    bench.start("second.csv")
    (elsewhere := tmp_path / "elsewhere").mkdir()
    other = opened_project(bench.opened.capture, Project(elsewhere, bench.opened.project.history, None), 2)
    bench.exporting.open(other)
    assert [status.state for status in bench.exporting.statuses] == ["waiting"]  # it goes on, and is listed
    bench.exporting.clear()
    bench.exporting.open(bench.opened)
    assert [status.state for status in bench.exporting.statuses] == ["waiting", "cancelled"]


def test_the_dialog_begins_with_what_was_chosen_last(bench: Bench):
    bench.timeline.seek(4)
    bench.timeline.set_range(1, 2)
    bench.ask()
    page = bench.exporting.page
    assert page is not None
    assert (page.context.clips, page.context.trained) == (((0, 3), (3, 6)), (0, 1))
    assert (page.context.frame_index, page.context.in_frame, page.context.out_frame) == (4, 1, 2)
    assert page.choices.kind == "gaussians"
    assert Path(bench.suggest(page.choices)).parent == Path.home()
    bench.start("first.csv")
    assert bench.exporting.page is None
    assert Settings(bench.settings.path).last_export.kind == "metrics"
    bench.ask()
    again = bench.exporting.page
    assert again is not None
    assert again.choices.kind == "metrics"
    assert again.choices.out == ""
    assert bench.suggest(again.choices) == str(bench.folder / "out" / "p-metrics.csv")


def test_nothing_trained_is_said_and_a_damaged_memory_is_none(bench: Bench):
    with pytest.raises(ProjectError, match="no clip is trained"):
        bench.ask(())
    assert bench.exporting.page is None
    bench.settings.set_last_export(ExportChoices(kind="kites"))
    bench.ask()
    page = bench.exporting.page
    assert page is not None
    assert page.choices.kind == next(iter(KINDS))


def test_the_plan_tells_files_bytes_and_room(bench: Bench):
    bench.ask()
    plan = bench.plan(METRICS.changed(out=str(bench.folder / "new" / "m.csv")))
    assert plan.problems == ()
    assert plan.n_files == 1
    assert plan.n_bytes > 1000
    assert plan.free_bytes is not None
    assert not (bench.folder / "new").exists()


@pytest.mark.parametrize(
    ("out", "said"),
    [
        ("", "Say where"),
        ("relative.csv", "full path"),
        ("{folder}/p/m.csv", "inside the project"),
        ("{folder}/ring/m.csv", "inside the capture"),
        ("{folder}/p/project.json/m.csv", "inside the project"),
        ("{folder}/settings.json/m.csv", "is a file"),
        ("{folder}", "folder, not a file"),
        ("{folder}/a\0b.csv", "cannot be written to"),
        ("~nobody-of-this-name/m.csv", "cannot be written to"),
    ],
)
def test_places_that_cannot_be_written_are_told_before(bench: Bench, out: str, said: str):
    bench.settings.set_last_export(METRICS)
    bench.ask()
    plan = bench.plan(METRICS.changed(out=out.format(folder=bench.folder)))
    assert len(plan.problems) == 1
    assert said in plan.problems[0]


def test_a_disk_without_room_is_told_before(bench: Bench, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("app.export.staging.LEAST_SPARE_BYTES", 1 << 60)
    monkeypatch.setattr("app.export.staging.SPARE_BYTES", 1 << 60)
    bench.ask()
    plan = bench.plan(METRICS.changed(out=str(bench.folder / "m.csv")))
    assert "are free" in plan.problems[0]


def test_untrained_clips_in_the_range_are_told_before(bench: Bench):
    bench.ask((0,))
    cameras = ExportChoices(kind="gaussians", frames="range", out=str(bench.folder / "g"))
    assert bench.plan(cameras).problems[0].startswith("Frames 3 to 5 ")
    assert bench.plan(cameras.changed(frames="all")).problems == ()
    bench.timeline.seek(5)
    bench.ask((0,))
    assert bench.plan(cameras.changed(frames="clip")).problems[0].startswith("Frames 3 to 5 ")


def test_frames_that_are_not_there_and_single_ones_are_told_in_plain_words(bench: Bench):
    bench.ask((0,))
    choices = ExportChoices(kind="gaussians", frames="range", out=str(bench.folder / "g"))
    for changes, said in (
        ({"in_frame": 4, "out_frame": 3}, ""),
        ({"clips": ((0, 5), (5, 6))}, "Frame 5 "),
        ({"clips": tuple((at, at + 1) for at in range(0, 6, 2))}, "Frames 2, 4 "),
    ):
        context = msgspec.structs.replace(context_of(bench), **changes)
        bench.exporting.page = ExportPage(context, choices)
        (problem,) = bench.plan(choices).problems
        assert problem.startswith(said)
        bench.ask((0,))


def test_the_plan_names_the_edits_that_go_along(tmp_path: Path):
    folder = train(tmp_path / "p", write_capture(tmp_path / "ring", n_frames=6), n_clips=2)
    with open_scripted(folder) as project:
        project.apply_edit("delete", Sphere((0.0, 0.0, 0.0), 1.0))
        project.apply_edit("expose", name="brighter", stops=1.0)
        project.switch_edit(project.apply_edit("hide", name="not now").edit_id, is_on=False)
    opened = open_trained(open_project(folder, is_writable=False))
    context = msgspec.structs.replace(CONTEXT, clips=((0, 3), (3, 6)), trained=(0, 1), has_edits=True)
    said = "2 edits are included: delete sphere of radius 1, brighter"
    for kind, takes_edits in (("gaussians", True), ("video", True), ("player", True), ("metrics", False)):
        choices = ExportChoices(kind=kind, out=str(tmp_path / "x"))
        choices = choices.changed(out=f"{choices.out}{Answers(context, choices).suffix}")
        assert (said in plan_export(opened, context, choices).lines) is takes_edits
        assert said not in plan_export(opened, context, choices.with_answer("has_edits", "false")).lines


@pytest.mark.parametrize("kind", ["gaussians", "video", "player", "metrics"])
@pytest.mark.parametrize("step", [1, 2])
def test_all_that_are_trained_may_have_gaps(tmp_path: Path, kind: str, step: int):
    folder = train(tmp_path / "p", write_capture(tmp_path / "ring", n_frames=9), n_clips=3)
    (folder / "clips" / "0001.safetensors").unlink()
    opened = open_trained(open_project(folder, is_writable=False))
    context = msgspec.structs.replace(CONTEXT, clips=((0, 3), (3, 6), (6, 9)), trained=(0, 2))
    choices = ExportChoices(kind=kind, out=str(tmp_path / "x")).with_step(step)
    choices = choices.changed(out=f"{choices.out}{Answers(context, choices).suffix}")
    plan = plan_export(opened, context, choices)
    assert plan.problems == ()
    if kind in ("player", "metrics"):
        assert plan.n_files >= 1
    elif kind == "video":
        assert "6 pictures" in plan.lines[0]  # a video has all frames
    else:
        assert plan.n_files == len([0, 1, 2, 6, 7, 8] if step == 1 else [0, 2, 6, 8]) + 1


@pytest.mark.parametrize(
    ("kind", "answer", "name", "said"),
    [
        ("video", "webm", "film.mp4", "has to end in .webm"),
        ("video", "mp4", "film.webm", "has to end in .mp4"),
        ("video", "mp4", "film", "has to end in .mp4"),
        ("video", "mp4", "film.MP4", ""),
        ("video", "png", "film.mp4", "export is a folder"),
        ("video", "png", "film", ""),
        ("metrics", "json", "m.csv", "has to end in .json"),
        ("player", "", "m.mp4", "ends in .html"),
        ("player", "", "m.htm", ""),
        ("gaussians", "ply", "m.v2", ""),
    ],
)
def test_a_name_that_says_something_else_is_told_before(bench: Bench, kind: str, answer: str, name: str, said: str):
    bench.ask()
    choices = ExportChoices(kind=kind, out=str(bench.folder / "new" / name)).with_answer("format", answer)
    problems = bench.plan(choices).problems
    assert len(problems) == bool(said)
    assert said in "".join(problems)


def test_what_another_export_will_write_is_taken(bench: Bench):
    bench.start("p-metrics.csv")
    bench.exporting.poll()
    bench.ask()
    out = bench.folder / "out"
    assert bench.suggest(METRICS) == str(out / "p-metrics-2.csv")
    for name in ("p-metrics.csv", "../out/p-metrics.csv", "p-metrics.csv/more.csv"):
        assert bench.plan(METRICS.changed(out=str(out / name))).problems == (TAKEN,)
    assert bench.plan(METRICS.changed(out=str(out / "other.csv"))).problems == ()
    with pytest.raises(ProjectError, match="Another running or waiting export"):
        bench.exporting.start(METRICS.changed(out=str(out / "p-metrics.csv")))
    assert len(bench.exporting.statuses) == 1
    bench.started[0].events.append(ExportFailed("The disk is full.", ""))
    bench.exporting.poll()
    assert bench.suggest(METRICS) == str(out / "p-metrics.csv")
    assert bench.plan(METRICS.changed(out=str(out / "p-metrics.csv"))).problems == ()
    bench.exporting.start(METRICS.changed(out=str(out / "p-metrics.csv")))
    with pytest.raises(ProjectError, match="Another running or waiting export"):
        bench.exporting.retry(1)


def test_names_and_camera_paths_are_waited_for_on_threads(bench: Bench, monkeypatch: pytest.MonkeyPatch):
    settled: list[str] = []
    looked: list[str] = []

    def exists(path: Path) -> bool:
        looked.append(threading.current_thread().name)
        return False

    monkeypatch.setattr("app.export.export_plan._exists", exists)
    for _ in range(2):  # what was on the disk at the first time says nothing about the second
        bench.exporting.ask(
            bench.opened, bench.timeline, (0, 1), settle=lambda: settled.append(threading.current_thread().name)
        )
        bench.suggest(METRICS)
        bench.plan(METRICS.changed(out=str(bench.folder / "m.csv")))
        bench.plan(METRICS.changed(out=str(bench.folder / "n.csv")))
        bench.exporting.close_page()
    assert settled == ["export plan"] * 2
    assert set(looked) == {"export name"}


def test_every_answer_of_every_form_makes_a_job_or_says_why_not(bench: Bench):
    bench.ask()
    page = bench.exporting.page
    assert page is not None
    for kind in KINDS:
        usual = ExportChoices(kind=kind, out=str(bench.folder / "new" / f"x{kind}"))
        for question in Answers(page.context, usual).questions:
            for value, words in question.values:
                assert words
                choices = usual.with_answer(question.name, value)
                answers = Answers(page.context, choices)
                choices = choices.changed(out=f"{choices.out}{answers.suffix}")
                job = Answers(page.context, choices).make_job()
                assert job.out == Path(choices.out)
                assert hash(job) == hash(job)  # a value


def test_exports_run_one_after_another_and_failures_are_told(bench: Bench):
    bench.start("a.csv")
    bench.start("b.csv")
    bench.is_training = True
    bench.exporting.poll()
    bench.is_training = False
    assert len(bench.started) == 1
    task = bench.started[0].task
    assert (task.job.kind, task.n_threads) == ("metrics", 1)
    assert Path(task.project) == bench.opened.project.folder
    bench.started[0].events.append(ExportFailed("The disk is full.", "Free some space."))
    bench.exporting.poll()
    assert [(notice.title, notice.detail) for notice in bench.notices] == [
        ("Metrics, CSV was not exported", "The disk is full.")
    ]
    bench.exporting.poll()
    assert bench.started[1].task.n_threads is None
    bench.exporting.cancel(2)
    assert bench.started[1].is_cancelled


def test_a_file_manager_that_is_missing_is_told(bench: Bench):
    bench.start()
    bench.exporting.poll()
    bench.exporting.show(1)  # nothing there yet
    result = ExportResult(bench.folder / "out" / "m.csv", 1, 5)
    bench.started[0].events.append(ExportDone(result))
    bench.exporting.poll()
    bench.exporting.show(1)
    bench.until(lambda: len(bench.notices) > 0)
    assert bench.shown == [result.path]
    assert "No file manager" in bench.notices[0].detail


def test_a_session_asks_and_closes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    session = Session(settings=Settings(tmp_path / "settings.json"), is_preloading=False)
    waits: list[str] = []
    try:
        monkeypatch.setattr(session.document, "settle", lambda: waits.append("settle"))
        session.dispatch(AskExport())  # nothing is open
        assert session.exporting.page is None
        session.dispatch(CancelExport(5))
        session.dispatch(ShowExport(5))
        session.dispatch(CloseQuestion())
        assert not list(session.notices)
        assert waits == []  # the window's thread waits for no disk
        monkeypatch.undo()
    finally:
        session.close()
