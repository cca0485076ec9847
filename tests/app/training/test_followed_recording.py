"""Clips are trained while their capture grows: each once its frames are there, with nothing of later ones."""

from __future__ import annotations

import resource
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from app.document.history import Undone
from app.evaluation.headless import train_clips
from app.project.opening.opening import open_capture_of
from app.project.opening.project_access import create_project, default_settings, open_project
from app.training.jobs import train_job
from app.training.recording.followed_recording import FollowedRecording
from app.training.recording.intake import FollowLimits, Intake, check_can_follow, n_taken_of
from app.training.service import TrainingService
from engine.capture.capture import Capture, open_capture
from engine.capture.growing.growth import Growth
from engine.capture.growing.watch import END_FILE, GrowthWatch
from engine.errors import ProjectError
from tests.app.conftest import inline
from tests.app.fakes import make_fake, write_capture
from tests.engine.capture.test_growing import Clock
from tests.faults.record import Recorder

PATIENCE_S = 10.0
LENGTH = 3


class Show:
    """A recording of a source capture, and the following of it, which a clock drives."""

    def __init__(self, source: Capture, folder: Path, n_before: int = LENGTH, **faults: object) -> None:
        self.recorder, self.clock, self.n = Recorder(source, folder / "c", **faults), Clock(), 0  # type: ignore[arg-type]
        for _ in range(n_before):
            self.write()
        self.folder, self.said, self.trained, self.jobs = folder, [], [], []
        capture = open_capture(folder / "c", is_growing=True).grown(n_before)
        settings = default_settings(capture, clip_length=LENGTH, overrides={"backgrounds": "clip"})
        self.project = create_project(folder / "p", settings)
        self.follow(capture)

    def follow(self, capture: Capture) -> None:
        project = self.project
        n_taken, names = n_taken_of(project.settings), capture.rig.names
        self.intake = Intake(
            capture,
            n_taken,
            LENGTH,
            is_wanted=lambda camera, frame: not project.document.exclusions.leaves_out(names[camera], frame),
            limits=FollowLimits(PATIENCE_S, until_idle_s=100.0),
            clock=self.clock,
        )

        def launch(job, project):
            self.jobs.append(job)
            return inline(job, project, make_fake)

        self.service = TrainingService(
            project, project.clips(n_taken), holdout=(0,), launch=launch, is_window_open=False
        )
        self.following = FollowedRecording(
            project,
            capture,
            self.service,
            self.intake,
            on_taken=lambda taken: self.said.extend(taken.words(PATIENCE_S)),
        )

    def write(self) -> None:
        self.recorder.write(self.n)
        self.n += 1

    def run(self, n_ticks: int, *, ends: bool = True) -> None:
        """Follow while so many moments are recorded, and to the end of the recording, or else an interruption."""
        left = n_ticks

        def more() -> list[int] | None:
            nonlocal left
            if left:
                self.write()
            elif ends:
                (self.folder / "c" / END_FILE).touch()
            left = max(left - 1, 0)
            self.clock.now_s += 1.0
            found = self.following.more()
            is_idle = len(self.trained) == len(self.service.clips)
            if found == [] and not left and not ends and is_idle:
                raise KeyboardInterrupt
            return found

        self.outcomes = train_clips(
            self.service,
            [i for i in self.service.catalog.order if self.service.catalog[i].state != "trained"],
            more=more,
            on_status=lambda status: None,
            on_event=lambda event: None,
            on_outcome=lambda outcome: self.trained.append((outcome.clip_index, self.n)),
            sleep=lambda seconds: None,
        )

    def close(self) -> None:
        self.service.close()
        self.project.close()


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    """Four cameras, eleven frames."""
    return open_capture(write_capture(tmp_path_factory.mktemp("source") / "c", n_frames=11))


def test_each_clip_is_trained_once_it_is_there_and_the_rest_at_the_end(source: Capture, tmp_path: Path) -> None:
    show = Show(source, tmp_path)
    with pytest.raises(KeyboardInterrupt):
        show.run(8, ends=False)
    assert [clip for clip, _ in show.trained] == [0, 1, 2], "a whole clip needs more than frames 9 and 10"
    assert show.project.settings.frames == (0, 9)
    show.close()

    show.project = open_project(tmp_path / "p")
    show.follow(open_capture(tmp_path / "c", is_growing=True, frames=(0, 9)))
    show.run(0)
    assert [clip for clip, _ in show.trained] == [0, 1, 2, 3], "the same command resumes"
    assert show.service.clips[3].n_frames == 2
    assert [job.frames for job in show.jobs] == [(0, 3), (0, 6), (0, 9), (0, 11)], "nothing may look further"
    assert all(show.service.catalog[index].state == "trained" for index in range(4))
    show.close()
    assert show.project.history.past == (), "growth cannot be undone"


def test_frames_that_do_not_come_are_excluded_with_a_note(source: Capture, tmp_path: Path) -> None:
    show = Show(source, tmp_path, lost=[("2", 4), ("2", 5)], torn=[("3", 7)])
    show.run(30)
    excluded = [(one.camera, one.first, one.stop) for one in show.project.document.exclusions.frames]
    assert excluded == [("2", 4, 6), ("3", 7, 8)]
    assert show.said[0].startswith("Camera 2 has not delivered frames 4 to 5 within 10 s")
    assert [clip for clip, _ in show.trained] == [0, 1, 2, 3]
    show.project.happen(Undone())
    assert show.project.settings.frames == (0, 11), "undo takes no frames away"
    show.close()


def test_a_shorter_last_clip_that_is_trained_is_not_made_longer(source: Capture, tmp_path: Path) -> None:
    show = Show(source, tmp_path)
    show.run(2)
    assert [clip.n_frames for clip in show.service.clips] == [3, 2]
    show.close()
    (tmp_path / "c" / END_FILE).unlink()
    show.write()
    show.project = open_project(tmp_path / "p")
    show.follow(open_capture(tmp_path / "c", is_growing=True, frames=(0, 5)))
    show.clock.now_s += 1.0
    with pytest.raises(ProjectError, match="ended at frame 5, and clip 1 was trained"):
        show.following.more()
    show.close()


def test_another_calibration_is_refused(source: Capture, tmp_path: Path) -> None:
    show = Show(source, tmp_path)
    show.close()
    meta = tmp_path / "c" / "train_meta.json"
    meta.write_text(meta.read_text().replace("30.0", "31.0"))
    with pytest.raises(ProjectError, match="is not the one this project was made for"):
        open_capture_of(show.project.settings, show.project.folder)


def test_what_looks_ahead_cannot_be_followed(source: Capture, tmp_path: Path) -> None:
    show = Show(source, tmp_path)
    settings = show.project.settings
    check_can_follow(settings)
    for overrides, word in (({}, "backgrounds=capture"), ({"backgrounds": "clip", "field": "joint"}, "field=joint")):
        with pytest.raises(ProjectError, match=word):
            check_can_follow(replace(settings, overrides=overrides))
    show.close()


def test_a_complete_project_looks_no_further_either_with_backgrounds_of_the_clip(make_opened) -> None:
    opened = make_opened("p")
    clip = opened.clips[0]
    assert train_job(opened.project, clip).frames is None
    assert train_job(opened.project, clip, overrides={"backgrounds": "clip"}).frames == (0, clip.stop)


def test_the_command_line_follows_and_says_what_is_wrong(run, source: Capture, tmp_path: Path) -> None:
    recorder = Recorder(source, tmp_path / "c", lost=[("1", 4)])
    for tick in range(11):
        recorder.write(tick)
    follow = ("follow", tmp_path / "c", "--clip-length", 3, "--patience", 0.3, "--until-idle", 0.6)
    code, _, err = run(*follow, "--project", tmp_path / "p")
    assert code == 0, err
    assert "Camera 1 has not delivered frame 4 within 0.3 s" in err
    assert "The recording has ended: 11 frames, 4 clips" in err
    code, _, err = run(*follow, "--project", tmp_path / "q", "--set", "backgrounds=capture")
    assert (code, "frames that do not exist yet" in err) == (2, True)
    for path in (tmp_path / "c" / "ims" / "3").iterdir():
        path.unlink()
    code, _, err = run(*follow, "--project", tmp_path / "r")
    assert (code, 'Camera "3": It has no frame so far' in err) == (2, True), "a camera that never delivers"
    code, _, err = run("follow", tmp_path / "nowhere", "--project", tmp_path / "r")
    assert (code, "There is no such folder" in err) == (2, True)
    assert not (tmp_path / "r").exists()


def test_a_folder_that_answers_slowly_is_asked_less_often(source: Capture, tmp_path: Path, monkeypatch) -> None:
    show, looked_s, look = Show(source, tmp_path), [], GrowthWatch.look

    def slow(watch: GrowthWatch) -> Growth:
        looked_s.append(show.clock.now_s)
        show.clock.now_s += 2.0
        return look(watch)

    monkeypatch.setattr(GrowthWatch, "look", slow)
    for _ in range(20):
        show.intake.ready()
        show.clock.now_s += 1.0
    show.close()
    assert [later - earlier for earlier, later in pairwise(looked_s)] == [10.0, 10.0]


@pytest.mark.parametrize(
    ("option", "expected"),
    [
        ("--patience=soon", "'soon' is not a number of seconds above 0"),
        ("--until-idle=nan", "'nan' is not a number of seconds above 0"),
        ("--end-at=0", "'0' is not a number of frames, 1 or more"),
    ],
)
def test_limits_that_are_not_valid_are_refused(run, tmp_path: Path, option: str, expected: str) -> None:
    code, _, err = run("follow", tmp_path / "c", "--project", tmp_path / "p", option)
    assert code == 2
    assert expected in err


@pytest.mark.slow
def test_memory_and_disk_stay_flat_over_hundreds_of_clips(source: Capture, tmp_path: Path) -> None:
    show = Show(source, tmp_path)
    files = sorted((tmp_path / "c").glob("ims/*/000000.jpg"))
    begun: list[float] = []

    def more() -> list[int] | None:
        if show.service.is_busy:
            return []
        n_clips = len(show.service.clips)
        if n_clips == 200:
            return None
        for frame in range(LENGTH * n_clips, LENGTH * (n_clips + 1)):
            for file in files:
                file.with_name(f"{frame:06d}.jpg").hardlink_to(file)
        show.clock.now_s += 1.0
        begun.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
        return show.following.more()

    train_clips(
        show.service,
        [0],
        more=more,
        on_status=lambda status: None,
        on_event=lambda event: None,
        on_outcome=lambda outcome: None,
        sleep=lambda seconds: None,
    )
    assert show.service.catalog.n_trained == 200
    assert begun[-1] - begun[40] < 40.0, "MB"
    left = {folder.name: len(list(folder.iterdir())) for folder in (tmp_path / "p").iterdir() if folder.is_dir()}
    assert left["clips"] == 200
    assert [left.get(name, 0) for name in ("live", "prep", "checkpoints", "versions")] == [0, 0, 0, 0]
    assert left["journal"] < 5
    show.close()
