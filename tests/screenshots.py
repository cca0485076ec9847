"""`python -m tests.screenshots [NAME ...]`: pictures of the window for the documents, see `make screenshots`.

Opens a trained project; only "two_clips_training" trains, in a copy. Each screen is a small function over a window that
shows the project; a new one is a function and a row in SCREENS.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pyglet

pyglet.options.headless = True  # before pyglet.window is imported
pyglet.options.shadow_window = False

from PIL import Image  # noqa: E402
from pyglet.window import key  # noqa: E402

from app.cli.cli import main as run_command  # noqa: E402
from app.playback.modes.arrays import Picture  # noqa: E402
from app.playback.modes.view_modes import COLOR  # noqa: E402
from app.project.project_picture import fitted  # noqa: E402
from app.project.recents import RecentProject  # noqa: E402
from app.session.captures.calibration_page import CalibrationPage, VideoFacts  # noqa: E402
from app.session.objects.object_commands import MakeObject  # noqa: E402
from app.session.projects.preferences import PreferencesFile  # noqa: E402
from app.session.projects.project_commands import OpenCapture  # noqa: E402
from app.session.projects.settings import Settings  # noqa: E402
from app.session.projects.window_memory import WindowMemory  # noqa: E402
from app.session.session import Session  # noqa: E402
from app.session.showing.look_commands import (  # noqa: E402
    ActivateView,
    LookThrough,
    SetCompare,
    SetFrame,
    SetMode,
    ShowHeat,
    ShowViews,
    ToggleOverlay,
)
from app.session.training.train_commands import TrainClips  # noqa: E402
from engine.assets import asset_path  # noqa: E402
from tests.ui.pilot import CTRL, Pilot  # noqa: E402
from ui.panels.state import RESIDUALS  # noqa: E402
from ui.shell.screenshot import read_window  # noqa: E402
from ui.shell.window import StudioWindow  # noqa: E402
from ui.viewport.hud_text import RENDERED  # noqa: E402

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "docs" / "images"
REVIEWED = ROOT / "out" / "screenshots"
QUICK_PROJECT = REVIEWED / "project"
SIZE = (1280, 800)
JPEG_QUALITY = 88
"""A third of the bytes of a PNG, and letters are still sharp."""
LEAST_SHARE = 0.2
"""Steps that a clip in training has to have done."""
TIMEOUT_S = 400.0
"""Kernels may have to be compiled first."""
SHOWN_FOLDER, CAPTURES = Path("/projects"), Path("/captures")
"""Where things seem to lie: pictures name no folder of the machine that they were made on."""


class _Session(Session):
    """The program's session, but for the project's folder in words."""

    def _refresh(self) -> None:
        super()._refresh()
        if self.project_status is not None:
            self.project_status = replace(self.project_status, folder=SHOWN_FOLDER / self.project_status.name)


class Stage:
    """One window on the project. pilot: Its keys and pointer."""

    def __init__(self, project: Path | None, folder: Path, size: tuple[int, int], scale: float, theme: str) -> None:
        self.session = _Session(settings=Settings(folder / "settings.json"))
        preferences = PreferencesFile(folder / f"preferences-{theme}.json")
        preferences.values.theme = "light" if theme == "light" else "dark"
        self.studio = StudioWindow(
            self.session,
            width=round(size[0] * scale),
            height=round(size[1] * scale),
            memory=WindowMemory(folder / "window.json", ui_scale=scale),
            preferences=preferences,
        )
        self.studio.window._enable_event_queue = False  # else events of the pilot would wait
        self.pilot = Pilot(self.studio)
        if project is not None:
            self.session.dispatch(OpenCapture(project))
            self.wait(lambda: self.session.capture is not None, "the project is open")
            self.session.recent.forget(project.resolve())  # its folder is one of this machine

    def wait(self, is_done: Callable[[], bool], what: str) -> None:
        """Let the window work until something is so; says what is not, where it takes too long."""
        deadline_s = time.monotonic() + TIMEOUT_S
        while not is_done():
            if time.monotonic() > deadline_s:
                sys.stderr.write(f"not in time: {what}\n")
                return
            self.studio.settle(1)
            time.sleep(0.01)

    def show_trained(self, frame_index: int | None = None) -> None:
        """Go to a frame, by default in the middle of the last trained clip, and wait for its picture."""
        trained = [
            clip for clip, found in zip(self.session.clips, self.session.clip_states, strict=True) if found.n_own
        ]
        if frame_index is None and trained:
            frame_index = trained[-1].start + trained[-1].n_frames // 2
        if frame_index is not None:
            self.session.dispatch(SetFrame(frame_index))
        self.rest()

    def rest(self) -> None:
        """Wait until what is shown is what was asked for, and nothing moves any more."""
        scene = self.studio.frame.viewport.scene

        def is_complete() -> bool:
            self.studio.settle(2)
            thumbnails = self.studio.frame.capture.is_waiting
            return scene.shows == RENDERED and not scene.shown.is_on_its_way and not thumbnails

        self.wait(is_complete, "the trained picture is shown")
        self.studio.settle(6, until_idle_s=2.0)

    def write(self, path: Path) -> int:
        """Write what stands in the window, small enough for a repository. Returns its bytes."""
        image = Image.fromarray(read_window(self.studio.ctx, *self.studio.window.get_framebuffer_size()))
        path.parent.mkdir(parents=True, exist_ok=True)
        image.save(path, quality=JPEG_QUALITY, subsampling=0, optimize=True)
        return path.stat().st_size

    def close(self) -> None:
        """End the window and the session."""
        self.studio.close()


# ---- screens -----------------------------------------------------------------------------------------------------


def draw_main(stage: Stage) -> None:
    """A trained frame with its cameras."""
    stage.show_trained()


def draw_training(stage: Stage) -> None:
    """Plan, curves and quality of the training panel, beside a comparison with the captured picture."""
    stage.show_trained()
    stage.session.dispatch(LookThrough(stage.session.holdout[0] if stage.session.holdout else 0))
    stage.session.dispatch(SetCompare("wipe"))
    stage.studio.frame.ui.is_quality_open = True
    stage.rest()


def draw_anchors(stage: Stage) -> None:
    """Inherited and residual anchors over a trained frame."""
    stage.show_trained()
    for name in ("show_inherited", "show_residual"):
        if not getattr(stage.session.overlays, name):
            stage.session.dispatch(ToggleOverlay(name))
    stage.rest()


def draw_flicker(stage: Stage) -> None:
    """Excess flicker at a boundary, and where it stands among all pictures."""
    clips = stage.session.clips
    stage.show_trained(clips[min(1, len(clips) - 1)].start)
    stage.session.dispatch(LookThrough(stage.session.holdout[0] if stage.session.holdout else 0))
    stage.session.dispatch(ShowHeat("E"))
    stage.studio.frame.ui.wanted_panel = RESIDUALS
    stage.rest()
    heat = stage.studio.frame.viewport.active.heat

    def is_measured() -> bool:
        status = stage.session.residual_status
        return heat.shown is not None and not heat.shown.is_stale and 0 < status.n_all == status.n_done

    stage.wait(is_measured, "every picture is measured")
    stage.studio.settle(6, until_idle_s=4.0)


def draw_modes(stage: Stage) -> None:
    """Four views of one frame: colour, depth, ellipsoids and what was born in this clip."""
    stage.show_trained()
    stage.session.dispatch(ShowViews(4))
    for index, mode in enumerate((COLOR, "depth", "ellipsoids", "birth")):
        stage.session.dispatch(ActivateView(index))
        stage.session.dispatch(SetMode(mode))
    stage.studio.settle(4)
    panes = stage.studio.frame.viewport.panes

    def is_complete() -> bool:
        stage.studio.settle(2)
        return all(pane.scene.shows == RENDERED and not pane.scene.shown.is_on_its_way for pane in panes)

    stage.wait(is_complete, "all four pictures are there")
    stage.studio.settle(6, until_idle_s=2.0)


def draw_palette(stage: Stage) -> None:
    """The palette, with something typed."""
    stage.show_trained()
    stage.pilot.key(key.K, modifiers=(CTRL,))
    stage.pilot.type("clip")
    stage.studio.settle(4)


def draw_objects(stage: Stage) -> None:
    """The sculpture of the sample as an object: its outline, its lane and its row in the panel."""
    stage.session.dispatch(LookThrough(0))
    stage.show_trained(5)
    rect = stage.pilot.rects["viewport.rendered"]
    stage.pilot.key(key.R)
    width, height = rect.x1 - rect.x0, rect.y1 - rect.y0
    left, top = rect.x0 + 0.33 * width, rect.y0 + 0.2 * height
    stage.pilot.drag((left, top), (left + 0.2 * width, top + 0.42 * height))
    stage.wait(lambda: stage.session.selection.n_gaussians > 0, "something is selected")
    stage.session.dispatch(MakeObject("sculpture"))
    stage.studio.settle(2)
    stage.wait(lambda: stage.session.objects.searched is None, "the object is found")
    stage.pilot.key(key.ESCAPE)
    stage.pilot.move(*rect.center)
    ui = stage.studio.frame.ui
    ui.objects.choose(stage.session.edits.objects[-1].object_id)
    ui.editing.wanted_section = "objects"
    outlines = stage.studio.frame.viewport.scene.objects
    stage.wait(lambda: not outlines.is_empty, "the outline is drawn")
    stage.rest()


def draw_two_clips(stage: Stage) -> None:
    """Two clips that train at once, with the live state of the one at the playhead."""
    session = stage.session
    left = [index for index, found in enumerate(session.clip_states) if found.state != "trained"]
    stage.studio.frame.ui.preferences.n_workers = 2
    stage.studio.settle(2)
    session.dispatch(SetFrame(session.clips[left[0]].start + 1))
    session.dispatch(TrainClips(tuple(left)))

    def is_seen() -> bool:
        stage.studio.settle(2)
        state = session.live_training.state_of(left[0])
        rates = [one.steps_per_s for one in session.training.trainings]
        shares = [one.step / max(one.n_steps, 1) for one in session.training.trainings]
        is_live = state is not None and state.is_live
        return is_live and len(rates) == 2 and min(rates) > 0 and min(shares) > LEAST_SHARE

    stage.wait(is_seen, "two clips train")
    stage.rest()


def draw_preferences(stage: Stage) -> None:
    """Keys of one's own."""
    stage.show_trained()
    stage.pilot.key(key.COMMA, modifiers=(CTRL,))
    stage.pilot.draw(3)
    stage.pilot.click("preferences.Keys")
    stage.studio.settle(4)


def draw_welcome(stage: Stage) -> None:
    """The first screen with projects that were opened lately."""
    stage.studio.settle(8)


def draw_opening(stage: Stage) -> None:
    """What is said and asked of a capture that has no project yet."""
    opening = stage.session.opening
    stage.session.dispatch(OpenCapture(asset_path("sample"), is_asking=True))
    stage.wait(lambda: opening.page is not None, "the capture is reported")
    page = opening.page
    assert page is not None
    opening.page = replace(page, report=replace(page.report, path=CAPTURES / "juggling room"))
    stage.wait(lambda: len(opening.pictures) == len(page.report.cameras), "all small pictures are there")
    stage.wait(lambda: opening.forecast(page.answers)[1], "the forecast is made")
    stage.studio.settle(6, until_idle_s=2.0)


def draw_calibration(stage: Stage) -> None:
    """The cameras of a folder of plain videos, and how they are to be calibrated."""
    cameras = tuple(VideoFacts(f"camera {row + 1}", (1920, 1080), 1800 + row % 3, 60.0) for row in range(12))
    stage.session.calibrating.page = CalibrationPage(CAPTURES / "garden", "asking", cameras)
    stage.studio.settle(4)
    stage.pilot.click("calibration.distance")
    stage.studio.settle(6)


@dataclass(frozen=True)
class Screen:
    """One picture.

    Attributes:
        name: Of the file.
        draw: Brings the window to what is to be seen.
        size, scale, theme: Of the window, units; pixels per unit; "dark" or "light".
        is_empty: Without a project.
        is_in_documents: Shown in the documents; the others are there to be looked at.
    """

    name: str
    draw: Callable[[Stage], None]
    size: tuple[int, int] = SIZE
    scale: float = 1.0
    theme: str = "dark"
    is_empty: bool = False
    is_in_documents: bool = True


SCREENS = (
    Screen("welcome", draw_welcome, is_empty=True),
    Screen("opening", draw_opening, is_empty=True),
    Screen("calibration", draw_calibration, is_empty=True),
    Screen("main", draw_main),
    Screen("training", draw_training),
    Screen("anchors", draw_anchors, is_in_documents=False),
    Screen("flicker", draw_flicker),
    Screen("modes", draw_modes),
    Screen("palette", draw_palette),
    Screen("objects", draw_objects, size=(1080, 700)),
    Screen("two_clips_training", draw_two_clips),
    Screen("preferences", draw_preferences, is_in_documents=False),
    Screen("light", draw_main, theme="light"),
    Screen("small", draw_main, size=(900, 600), is_in_documents=False),
    Screen("double", draw_main, size=(900, 600), scale=2.0, is_in_documents=False),
)


def make_quick_project() -> Path:
    """The project that serves when none is given: the sample's first clips with the smallest preset; made once."""
    if not (QUICK_PROJECT / "clips").is_dir():
        sample = str(asset_path("sample"))
        code = run_command(["train", sample, "--project", str(QUICK_PROJECT), "--clips", "0:2", "--preset", "toy"])
        if code:
            sys.exit(code)
    return QUICK_PROJECT


def write_screens(project: Path, out: Path, names: list[str]) -> None:
    """Make the pictures of these names, or all of them, from a copy of the project."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        copy = shutil.copytree(project, folder / project.name)
        small: Any = None
        wanted = [screen for screen in SCREENS if not names or screen.name in names]
        for screen in sorted(
            wanted, key=lambda screen: screen.is_empty
        ):  # the first screen shows a picture of the others
            stage = Stage(None if screen.is_empty else copy, folder, screen.size, screen.scale, screen.theme)
            try:
                if screen.is_empty:
                    _fill_recent(stage, project.name, small)
                screen.draw(stage)
                path = (out if screen.is_in_documents else REVIEWED) / f"{screen.name}.jpg"
                n_bytes = stage.write(path)
                if small is None and not screen.is_empty:
                    small = _picture_in(stage)
            finally:
                stage.close()
            sys.stdout.write(f"{path}  {n_bytes / 1000:.0f} kB\n")


def _picture_in(stage: Stage) -> Any:
    """What stands in the middle of the window, as a small picture of the project."""
    rect = stage.pilot.rects["viewport.rendered"]
    scale = stage.studio.frame.backend.pixels_per_unit
    x0, y0, x1, y1 = (round(value * scale) for value in (rect.x0, rect.y0, rect.x1, rect.y1))
    margin = (y1 - y0) // 5
    return fitted(stage.pilot.picture()[y0 + margin : y1 - margin, x0:x1])


def _fill_recent(stage: Stage, name: str, small: Any) -> None:
    """Projects in the list of the first screen."""
    stage.studio.settle(8, until_idle_s=1.0)  # pictures of real projects come first
    now = datetime.now(UTC)
    rows = ((name, 3, 3, timedelta()), ("basketball", 2, 70, timedelta(days=1)), ("kitchen", 0, 12, timedelta(days=5)))
    entries = [
        RecentProject(str(SHOWN_FOLDER / name), f"/captures/{name}", name, n_trained, n_clips, (now - age).isoformat())
        for name, n_trained, n_clips, age in rows
    ]
    stage.session.recent.entries[:] = entries
    stage.session.recent.missing = frozenset()
    if small is not None:
        stage.session.recent.pictures.found = {entries[0].folder: Picture(small, "project")}


def main() -> None:
    """Parse the command line and write the pictures."""
    parser = argparse.ArgumentParser(prog="python -m tests.screenshots", description=__doc__)
    parser.add_argument("names", nargs="*", help=f"of {', '.join(screen.name for screen in SCREENS)}; all by default")
    parser.add_argument("--project", type=Path, help="trained project (default: one that is made from the sample)")
    parser.add_argument("--out", type=Path, default=OUT)
    options = parser.parse_args()
    unknown = set(options.names) - {screen.name for screen in SCREENS}
    if unknown:
        parser.error(f"there is no screen of this name: {', '.join(sorted(unknown))}")
    write_screens(options.project or make_quick_project(), options.out, options.names)


if __name__ == "__main__":
    main()
