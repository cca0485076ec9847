"""How long does a project of many clips take to open, and how long does it hold up the window?

    python tests/benchmarks/bench_project.py [--clips 1000] [--metrics-rows 200]

Makes a tiny capture and a project of clips that go on from each other, opens it in a window without a screen, and
prints the time until every clip has its state, and the longest call on the window's thread: turns of the loop, frames,
scrubbing, the end of a training. Files are tiny: a real clip's header is as long, its arrays are not read.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import pyglet

pyglet.options.headless = True
pyglet.options.shadow_window = False

OPEN_TARGET_S = 1.5
CALL_TARGET_MS = 100.0


def make(folder: Path, n_clips: int, n_rows: int) -> Path:
    """A capture of one frame per clip, and a project of it in which every clip is trained. Returns the project."""
    from app.document.storing.document_file import PROJECT_FILE
    from app.project.opening.project_access import default_settings
    from engine.capture.capture import open_capture
    from tests.app.fakes import write_capture
    from tests.app.made_projects import make_chain

    capture = open_capture(write_capture(folder / "capture", n_cameras=3, n_frames=n_clips, size=(16, 12)))
    settings = asdict(default_settings(capture, clip_length=1))
    project = make_chain(
        folder / "project", n_clips, **{key: settings[key] for key in ("capture", "fingerprint", "holdout")}
    )
    rows = "".join(
        json.dumps({"step": step, "loss": 1 / (step + 1), "held_out_psnr": 20.0}) + "\n" for step in range(n_rows)
    )
    project.metrics_path(0).parent.mkdir()
    for clip_index in range(n_clips):
        project.metrics_path(clip_index).write_text(rows)
    project.close()
    assert (project.folder / PROJECT_FILE).is_file()
    return project.folder


class Calls:
    """The longest calls by what they were."""

    def __init__(self) -> None:
        self.longest_ms: dict[str, float] = {}

    def time(self, name: str, call: Callable[[], Any]) -> Any:
        """Carry out a call and remember how long it took."""
        started_s = time.perf_counter()
        result = call()
        took_ms = (time.perf_counter() - started_s) * 1e3
        self.longest_ms[name] = max(self.longest_ms.get(name, 0.0), took_ms)
        return result


def measure(folder: Path, n_clips: int) -> tuple[float, Calls]:
    """Open the project and use it. Returns seconds until all states are there, and the calls."""
    from app.session.commands import CloseQuestion
    from app.session.projects.project_commands import OpenProject
    from app.session.projects.settings import Settings
    from app.session.session import Session
    from app.session.showing.look_commands import SetFrame
    from app.session.training.train_commands import TrainClip
    from ui.main import SWITCH_INTERVAL_S
    from ui.shell.window import StudioWindow

    sys.setswitchinterval(SWITCH_INTERVAL_S)
    calls = Calls()
    session = Session(settings=Settings(folder.parent / "settings.json"))
    studio = StudioWindow(session, width=1600, height=1000, fixed_delta_s=1 / 60)
    studio.settle(8, until_idle_s=5.0)

    def turn(what: str) -> None:
        if calls.time(f"{what}: turn of the loop", lambda: studio.frame.update(1 / 60)):
            calls.time(f"{what}: frame", studio.draw)

    started_s = time.perf_counter()
    session.dispatch(OpenProject(folder))
    while not session.clip_states:
        turn("opening")
        time.sleep(0.002)
    open_s = time.perf_counter() - started_s
    assert [state.state for state in session.clip_states] == ["trained"] * n_clips, list(session.notices)
    for _ in range(10):
        studio.frame.request_redraw()
        turn("standing")
    for clip_index in range(0, n_clips, max(n_clips // 40, 1)):
        calls.time("scrubbing: command", partial(session.dispatch, SetFrame(clip_index)))
        studio.frame.request_redraw()
        turn("scrubbing")
    calls.time("asking before training again", lambda: session.dispatch(TrainClip(0)))
    session.dispatch(CloseQuestion())
    service = session.live_training.service
    assert service is not None
    calls.time("the end of a training: states", lambda: service.catalog.update(n_clips // 2))
    calls.time("the end of a training: refresh", lambda: session.dispatch(SetFrame(0)))
    studio.close()
    return open_s, calls


def main() -> int:
    """Run and print; the exit code tells whether the targets were reached."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clips", type=int, default=1000)
    parser.add_argument("--metrics-rows", type=int, default=200)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        project = make(Path(name), options.clips, options.metrics_rows)
        open_s, calls = measure(project, options.clips)
    print(f"{options.clips} chained clips: all states after {open_s:.2f} s (target {OPEN_TARGET_S} s)")
    for what, took_ms in sorted(calls.longest_ms.items(), key=lambda item: -item[1]):
        print(f"  {what:42} {took_ms:8.1f} ms at most")
    print(
        f"{platform.platform()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}, "
        f"Python {platform.python_version()}"
    )
    return 0 if open_s <= OPEN_TARGET_S and max(calls.longest_ms.values()) <= CALL_TARGET_MS else 3


if __name__ == "__main__":
    sys.exit(main())
