"""Fixtures of the application tests: a tiny capture, and a session that trains inline."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from app.cli.cli import main
from app.plan import speed
from app.project.opening.opened_project import OpenedProject, opened_project
from app.project.opening.project_access import create_project, default_settings
from app.project.project import Project
from app.session.editing import kept_document
from app.session.projects.project_commands import OpenCapture
from app.session.projects.settings import Settings
from app.session.session import Session
from app.training import service
from app.training.messages import TrainJob
from app.training.worker.interface import MakeTraining
from engine.capture.capture import open_capture
from tests.app.fakes import make_fake, write_capture
from tests.app.inline_worker import InlineWorker

DEADLINE_S = 300.0
"""Only a hang takes longer, on however busy a machine."""


@pytest.fixture(scope="session")
def capture_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four cameras, six frames."""
    return write_capture(tmp_path_factory.mktemp("capture") / "ring")


@pytest.fixture(autouse=True)
def own_user_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing of a test reaches the user's own data."""
    for name in ("XDG_DATA_HOME", "XDG_CONFIG_HOME"):
        monkeypatch.setenv(name, str(tmp_path / name.lower()))


@pytest.fixture(autouse=True)
def known_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """No test measures how fast this machine is, or its disk."""
    monkeypatch.setattr(kept_document, "SETTLE_S", DEADLINE_S)
    monkeypatch.setattr(speed, "is_cache_warm", lambda: True)
    monkeypatch.setattr(speed, "_known", {})
    monkeypatch.setattr(speed, "run_child", lambda *_, **__: 0.0123)


@pytest.fixture(autouse=True)
def disk_nearby(monkeypatch: pytest.MonkeyPatch) -> None:
    """Claims are waited for however busy the computer is."""
    monkeypatch.setattr(service, "PATIENCE_S", DEADLINE_S)


def inline(job: TrainJob, project: Project, make_training: MakeTraining = make_fake) -> InlineWorker:
    """A launch function for sessions and services."""
    return InlineWorker(job, project.folder, make_training)


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Runs a command; gives exit code, standard output and standard error."""

    def run_command(*arguments: object, make_training=make_fake) -> tuple[int, str, str]:
        code = main([str(part) for part in arguments], launch=partial(inline, make_training=make_training))
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run_command


def poll_until(session: Session, is_done: Callable[[], bool], *, what: str = "the condition") -> None:
    """Poll until something holds; fails after a deadline that only a hang reaches."""
    until_s = time.monotonic() + DEADLINE_S
    while not is_done():
        assert time.monotonic() < until_s, f"{what} did not come; {session.training} {list(session.notices)}"
        session.poll()
        time.sleep(0)  # lets threads run; nothing is awaited by it


@pytest.fixture
def make_opened(tmp_path: Path, capture_folder: Path) -> Iterator[Callable[..., OpenedProject]]:
    """Opens new projects of the tiny capture in clips of three frames, nothing trained; closes them in the end."""
    made: list[OpenedProject] = []

    def make(name: str = "p", *, generation: int = 1) -> OpenedProject:
        capture = open_capture(capture_folder)
        project = create_project(tmp_path / name, default_settings(capture, clip_length=3))
        made.append(opened_project(capture, project, generation))
        return made[-1]

    yield make
    for opened in made:
        opened.project.close()
        opened.capture.close()


@pytest.fixture
def make_session(tmp_path: Path, capture_folder: Path) -> Iterator[Callable[..., Session]]:
    """Makes sessions with the tiny capture open in clips of three frames; closes them in the end."""
    made: list[Session] = []

    def make(*, make_training: MakeTraining = make_fake, launch=None, is_open: bool = True, name: str = "p") -> Session:
        session = Session(
            project_dir=tmp_path / name,
            launch=launch or partial(inline, make_training=make_training),
            settings=Settings(tmp_path / "settings.json"),
            is_preloading=False,
        )
        made.append(session)
        if is_open:
            session.dispatch(OpenCapture(capture_folder))
            poll_until(session, lambda: session.capture is not None, what="the capture")
        return session

    yield make
    for session in made:
        session.close()
