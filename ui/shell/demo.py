"""The program's job without a display: train the reference clip and the next one, measure them, and leave a picture of
the window and a short video.

Training, measuring and rendering are the command line's own; only the picture of the window is made here. Where no
OpenGL can be had, that picture is left out and the rest is done.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from app.cli.arguments import EXIT_BAD_INPUT
from app.cli.terminal.progress import ProgressLine
from app.document.storing.document_file import PROJECT_FILE
from app.session.projects.project_commands import OpenCapture
from app.session.session import Session
from app.session.showing.look_commands import SetFrame, ToggleOverlay

if TYPE_CHECKING:
    from ui.shell.window import StudioWindow

logger = logging.getLogger(__name__)

PICTURE_SIZE = (1280, 800)
OPEN_TIMEOUT_S = 120.0
PICTURE_TIMEOUT_S = 60.0
THUMBNAILS_TIMEOUT_S = 10.0
POLL_S = 0.02
QUICK_OVERRIDES = (
    "static_steps=20",
    "joint_steps=30",
    "source_steps=30",
    "max_static_points=4000",
    "max_moving_points=4000",
)
"""Too few steps for a good picture; enough to see that every part works."""


def run_demo(capture_path: Path, out_dir: Path, quick: bool = False) -> int:
    """Do everything once and say where the results lie.

    Args:
        capture_path: Capture folder; or a project folder, which then is the one trained in.
        out_dir: Gets project/ or project_quick/, metrics.json, window.png and held_out.mp4. A second run continues
            from the first.
        quick: Train a few steps only.
    Returns:
        0 when training, measuring and video worked; otherwise the exit code of what did not, 2 for a bad capture.
    """
    from app.cli.cli import main as run_command

    line = ProgressLine()
    is_project = (capture_path / PROJECT_FILE).is_file()
    project_dir = capture_path if is_project else out_dir / ("project_quick" if quick else "project")
    session = Session(project_dir=project_dir, is_preloading=False)  # neither cloud nor forecast is in the picture
    try:
        if not _open(session, capture_path, line):
            return EXIT_BAD_INPUT
        assert session.capture is not None
        capture_path = session.capture.path
        n_clips = min(2, len(session.clips))
        n_frames = session.clips[n_clips - 1].stop
        camera = session.rig.names[session.holdout[0] if session.holdout else 0]
    finally:
        session.close()

    clips = f"0:{n_clips}"
    overrides = [part for override in QUICK_OVERRIDES for part in ("--set", override)] if quick else []
    metrics, video = out_dir / "metrics.json", out_dir / "held_out.mp4"
    steps: list[list[str]] = [
        ["train", str(capture_path), "--project", str(project_dir), "--clips", clips, *overrides],
        ["eval", str(project_dir), "--clips", clips, "--json", str(metrics)],
        ["render", str(project_dir), "--camera", camera, "--frames", f"0:{n_frames}", "--out", str(video)],
    ]
    for arguments in steps:
        code = int(run_command(arguments) or 0)
        if code != 0:
            return code
    picture = picture_of_window(capture_path, project_dir, out_dir / "window.png", line)
    line.say("")
    line.say(f"Project        {project_dir.resolve()}")
    line.say(f"Measurements   {metrics.resolve()}")
    line.say(f"Video          {video.resolve()} (camera {camera})")
    if picture is not None:
        line.say(f"Window         {picture.resolve()}")
    line.finish()
    return 0


def picture_of_window(capture_path: Path, project_dir: Path, path: Path, line: ProgressLine) -> Path | None:
    """Draw the window off screen on the newest trained clip, with overlays, and write it as PNG.

    Returns:
        The file, or None where no OpenGL can be had; the reason was said then.
    """
    import pyglet

    pyglet.options.headless = True  # before pyglet.window is imported: that would look for a display
    pyglet.options.shadow_window = False
    session = Session(project_dir=project_dir, is_preloading=False)  # neither cloud nor forecast is in the picture
    try:
        try:
            from ui.shell.window import StudioWindow

            studio = StudioWindow(session, width=PICTURE_SIZE[0], height=PICTURE_SIZE[1])
        except Exception as error:  # a missing library or driver shows as one of many kinds
            logger.info("no OpenGL without a display", exc_info=True)
            line.say(f"No picture of the window: OpenGL without a display is not available ({error}).")
            line.say("`make setup` installs the system libraries that it needs, or prints the command that does.")
            return None
        try:
            return _draw_window(studio, session, capture_path, path, line)
        finally:
            studio.close()
    finally:
        session.close()


def _draw_window(
    studio: StudioWindow, session: Session, capture_path: Path, path: Path, line: ProgressLine
) -> Path | None:
    from ui.shell.screenshot import read_window, write_png
    from ui.viewport.hud_text import RENDERED

    if not _open(session, capture_path, line):
        return None
    trained = [clip for clip, state in zip(session.clips, session.clip_states, strict=True) if state.state == "trained"]
    if trained:
        session.dispatch(SetFrame(trained[-1].start + trained[-1].n_frames // 2))
    for name in ("show_inherited", "show_residual"):
        if not getattr(session.overlays, name):
            session.dispatch(ToggleOverlay(name))

    def is_complete() -> bool:
        studio.settle(2)
        scene = studio.frame.viewport.scene
        return scene.shows == RENDERED and not scene.shown.is_on_its_way and scene.counts.n_inherited > 0

    if not _wait(session, is_complete, PICTURE_TIMEOUT_S):
        line.say("The trained picture was not ready in time; the window is shown as it is.")

    def has_thumbnails() -> bool:
        studio.settle(1)
        return not studio.frame.capture.is_waiting

    _wait(session, has_thumbnails, THUMBNAILS_TIMEOUT_S)
    studio.settle(2)
    return write_png(read_window(studio.ctx, *PICTURE_SIZE), path)


def _open(session: Session, capture_path: Path, line: ProgressLine) -> bool:
    """Open and wait; says what is wrong when it cannot be opened."""
    session.dispatch(OpenCapture(capture_path))
    _wait(session, lambda: session.capture is not None or len(session.notices) > 0, OPEN_TIMEOUT_S)
    for notice in session.notices:
        line.say(" ".join(part for part in (f"{notice.title}.", notice.detail, notice.hint) if part))
    return session.capture is not None


def _wait(session: Session, is_done: Callable[[], bool], timeout_s: float) -> bool:
    deadline_s = time.monotonic() + timeout_s
    while time.monotonic() < deadline_s:
        session.poll()
        if is_done():
            return True
        time.sleep(POLL_S)
    return False
