"""One hour of use by a program: does the window hold more and more memory, handles or threads?

python -m tests.soak.soak --minutes 60 [--project FOLDER] [--no-window]

Each round opens a project, trains a clip in a process, scrubs, looks at what is drawn, selects, edits, takes back and
does again, and goes on to another project; now and then session and window are closed and made anew, and frames are
exported. The session, its threads, its processes and the window are the real ones; trainings are made up and over in
a moment. With a DISPLAY the window is on it, otherwise it is drawn off screen. With --project, a copy of a trained
project is one of those that are opened. Fails where memory or handles have grown by more than MAX_GROWTH.
"""

from __future__ import annotations

import argparse
import logging
import math
import os
import random
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from app.document.changes.edit_changes import MAX_EDITS
from app.project.project import Project
from app.session.commands import DismissNotice
from app.session.editing.edit_commands import (
    AddEdit,
    MoveEdit,
    PutMarker,
    Redo,
    RemoveEdit,
    RemoveMarker,
    ToggleEdit,
    Undo,
)
from app.session.editing.selection_commands import (
    ClearSelection,
    InvertSelection,
    SelectAll,
    SelectByAttribute,
    SelectVolume,
)
from app.session.export_commands import AskExport, ClearExports, StartExport
from app.session.projects.project_commands import OpenProject
from app.session.projects.settings import Settings
from app.session.session import Session
from app.session.showing.look_commands import LookThrough, SetFrame, SetMode, ShowHeat, TogglePlay
from app.session.training.train_commands import TrainClip
from app.training.messages import TrainJob
from app.training.process import ProcessWorker
from app.training.service import Launch
from engine.editing.actions import Delete, Expose, Hide, Hold, Recolor, Smooth, Transform
from engine.editing.edit import Scope, Sphere
from tests.app.fakes import write_capture
from tests.app.lab.report.made_up import train
from tests.soak.held import Growth, Held, growths, handle_names, held_now

MAX_GROWTH = 0.05
WAIT_S = 600.0
"""Only a hang takes longer."""
ROUNDS_OF_AN_EXPORT = 10
ACTIONS = (
    Hide(),
    Delete(),
    Transform((0.1, 0.0, 0.0), scale=1.5),
    Recolor((1.0, 0.0, 0.0), 0.5),
    Expose(0.5),
    Hold(1),
    Smooth(1.5),
)
COMPARED = ("memory_mb", "handles", "threads", "children")


def launch(job: TrainJob, project: Project) -> ProcessWorker:
    """Trainings that are made up, in processes as real ones."""
    return ProcessWorker(job, project, "tests.app.fakes:make_fake")


class Soak:
    """Rounds of use.

    Args:
        work: An empty folder.
        extra: A trained project, which is copied and used beside the made ones.
        has_window: Whether a window is drawn, too.
        start: Starts a training.
        rounds_of_a_session: After so many, session and window are closed and made anew.
        n_seeks: Frames that each round goes to.
        is_preloading: See Session.
    """

    def __init__(
        self,
        work: Path,
        *,
        extra: Path | None = None,
        has_window: bool,
        start: Launch = launch,
        rounds_of_a_session: int = 6,
        n_seeks: int = 24,
        is_preloading: bool = True,
    ) -> None:
        self._work, self._has_window, self._start = work, has_window, start
        self._rounds_of_a_session, self._n_seeks = rounds_of_a_session, n_seeks
        self._is_preloading = is_preloading
        self._random = random.Random(1)
        self._projects = [
            train(
                work / name, write_capture(work / f"capture-{name}", n_cameras=5, n_frames=12, size=(96, 64)), n_clips=4
            )
            for name in ("a", "b")
        ]
        self._made = len(self._projects)
        if extra is not None:
            self._projects.append(Path(shutil.copytree(extra, work / "extra")))
        self._studio: Any = None
        self._session = self._open_session()
        self.samples: list[Held] = []

    def _open_session(self) -> Session:
        session = Session(
            launch=self._start,
            settings=Settings(self._work / "settings.json"),
            is_preloading=self._is_preloading,
        )
        if self._has_window:
            from ui.shell.window import StudioWindow

            self._studio = StudioWindow(session, width=1280, height=800)
        return session

    @property
    def period(self) -> int:
        """After so many rounds the same projects come in the same moments of a session."""
        return math.lcm(len(self._projects), self._rounds_of_a_session)

    def close(self) -> None:
        """End everything."""
        if self._studio is not None:
            self._studio.close()
            self._studio = None
        self._session.close()

    def round(self) -> Held:
        """One round. What is held at its end, which is the same moment in each."""
        n = len(self.samples)
        project = self._projects[n % len(self._projects)]
        if n and n % self._rounds_of_a_session == 0:
            self.close()
            self._session = self._open_session()
        self._open(project)
        if n % len(self._projects) < self._made:
            self._train()
        self._scrub()
        self._edit()
        if n % ROUNDS_OF_AN_EXPORT == ROUNDS_OF_AN_EXPORT - 1:
            self._export(n)
        self._open(self._projects[0])
        self._do(SetFrame(0))
        self._draw(10)
        self._wait("rest", lambda session: not session.jobs and session.training.state in ("idle", "failed"))
        held = held_now()
        self.samples.append(held)
        return held

    # ---- pieces of a round

    def _open(self, project: Path) -> None:
        self._do(OpenProject(project))
        self._wait(
            f"the project {project.name}",
            lambda session: session.project is not None and session.project.folder.resolve() == project.resolve(),
        )

    def _train(self) -> None:
        clip_index = self._random.randrange(1, len(self._session.clips))
        self._do(TrainClip(clip_index, is_confirmed=True))
        self._wait("the training", lambda session: session.training.state in ("idle", "failed"))
        assert self._session.clip_states[clip_index].state == "trained", self._session.clip_states

    def _scrub(self) -> None:
        session = self._session
        for _ in range(self._n_seeks):
            self._do(SetFrame(self._random.randrange(session.timeline.n_frames)))
            self._draw(1)
            session.request_render(320, 240)
        for mode in ("anchors", "depth", "color"):
            self._do(SetMode(mode))
            self._draw(3)
        self._do(LookThrough(0))
        for heat in ("error", ""):
            self._do(ShowHeat(heat))
            self._draw(5)
        self._do(LookThrough(None))
        self._do(TogglePlay())
        self._draw(20)
        self._do(TogglePlay())
        self._wait("the picture", lambda session: session.request_render(320, 240) is not None)

    def _edit(self) -> None:
        session, document = self._session, self._session.document
        before = self._edits()
        assert len(before) < MAX_EDITS
        for index, action in enumerate(ACTIONS):
            self._do(AddEdit(action, Sphere((0.1 * index, 0.0, 0.0), 0.7), Scope(index % 3, 9), name=f"edit {index}"))
            self._draw(2)
        added = [edit.edit_id for edit in self._edits()[len(before) :]]
        assert len(added) == len(ACTIONS), list(session.notices)
        self._do(ToggleEdit(added[0]))
        self._do(MoveEdit(added[-1], 0))
        self._do(PutMarker(3, "here"))
        for select in (
            SelectAll(),
            SelectVolume(Sphere((0.5, 0.5, 0.5), 0.5)),
            SelectByAttribute("opacity", 0.0, 0.6),
            InvertSelection(),
            ClearSelection(),
        ):
            self._do(select)
            self._draw(2)
        kept = document.content
        for _ in range(6):
            self._do(Undo())
            self._draw(1)
        for _ in range(6):
            self._do(Redo())
        assert document.content == kept
        for edit_id in added:
            self._do(RemoveEdit(edit_id))
        self._do(RemoveMarker(3))
        assert self._edits() == before

    def _edits(self) -> tuple[Any, ...]:
        content = self._session.document.content
        assert content is not None
        return content.edits

    def _export(self, number: int) -> None:
        session, out = self._session, self._work / f"export-{number}"
        self._do(AskExport())
        page = session.exporting.page
        assert page is not None, list(session.notices)
        self._do(StartExport(page.choices.changed(kind="gaussians", frames="frame", out=str(out))))
        self._wait("the export", lambda session: not session.exporting.is_busy)
        assert out.is_dir(), session.exporting.statuses
        self._do(ClearExports())
        shutil.rmtree(out)

    # ---- driving

    def _do(self, command: Any) -> None:
        self._session.dispatch(command)
        errors = [notice for notice in self._session.notices if notice.kind == "error"]
        assert not errors, errors
        while len(list(self._session.notices)):
            self._session.dispatch(DismissNotice(0))

    def _draw(self, n_frames: int) -> None:
        for _ in range(n_frames):
            if self._studio is None:
                self._session.poll()
            else:
                self._studio.window.dispatch_events()
                self._studio.tick(1 / 60)

    def _wait(self, what: str, is_so: Callable[[Session], bool]) -> None:
        until_s = time.monotonic() + WAIT_S
        while not is_so(self._session):
            assert time.monotonic() < until_s, f"waited for {what}: {list(self._session.notices)}"
            self._draw(1)
            time.sleep(0.005)


def report(soak: Soak, *, warm_up: int) -> list[Growth]:
    """Print how far everything has grown; returns what has grown too far."""
    found = growths(soak.samples, warm_up=warm_up, period=soak.period)
    for growth in found:
        print(f"  {growth.text()}", flush=True)
    return [growth for growth in found if growth.name in COMPARED and growth.share > MAX_GROWTH]


def main() -> int:
    """Run it. Returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--project", type=Path, help="a trained project to use as well; a copy of it is")
    parser.add_argument("--no-window", action="store_true")
    parser.add_argument("--every", type=int, default=10, metavar="N", help="say what is held every N rounds")
    options = parser.parse_args()
    logging.disable(logging.INFO)
    if not options.no_window:
        prepare_window()
    with tempfile.TemporaryDirectory(prefix="clipgstream-soak-") as folder:
        for name in ("XDG_DATA_HOME", "XDG_CONFIG_HOME"):
            os.environ[name] = f"{folder}/{name.lower()}"
        soak = Soak(Path(folder), extra=options.project, has_window=not options.no_window)
        started_s = time.monotonic()
        try:
            while time.monotonic() - started_s < 60 * options.minutes:
                held = soak.round()
                if (len(soak.samples) - 1) % options.every == 0:
                    minutes = (time.monotonic() - started_s) / 60
                    print(f"{minutes:6.1f} min, round {len(soak.samples)}: {held}", flush=True)
        finally:
            soak.close()
        minutes = (time.monotonic() - started_s) / 60
        if len(soak.samples) <= WARM_UP_ROUNDS:
            print(f"{len(soak.samples)} rounds in {minutes:.0f} min are too few to say anything")
            return 1
        print(f"{len(soak.samples)} rounds in {minutes:.0f} min, after warming up for {WARM_UP_ROUNDS}:")
        bad = report(soak, warm_up=WARM_UP_ROUNDS)
    for growth in bad:
        print(f"{growth.name} has grown by more than {100 * MAX_GROWTH:.0f} %; open handles: {handle_names()}")
    return 1 if bad else 0


WARM_UP_ROUNDS = 12
"""Two sessions long."""


def prepare_window() -> None:
    """Before anything imports pyglet.window."""
    import pyglet

    pyglet.options.headless = not os.environ.get("DISPLAY")
    pyglet.options.shadow_window = False


if __name__ == "__main__":
    sys.exit(main())
