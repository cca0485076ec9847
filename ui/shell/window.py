"""The pyglet window: a GL 3.3 core context, the loop, and the events that are not ImGui's (drop, close, resize).

Owns the window and its context. Drawing is ui.shell.frame's business.
"""

from __future__ import annotations

import logging
import signal
import sys
import time
from pathlib import Path
from typing import Any

import moderngl
import pyglet
from pyglet.event import EVENT_HANDLED

from app.session.projects.preferences import PreferencesFile
from app.session.projects.window_memory import WindowMemory
from app.session.session_view import WindowSession
from engine.text import one_line
from ui.gl import free_dropped
from ui.shell.frame import Frame
from ui.style.ui_scale import MIN_UNITS, UiScale

logger = logging.getLogger(__name__)

TICK_S = 1 / 60
PICTURE_EVENT = "on_studio_picture"
DEFAULT_SIZE = (1440, 900)
"""In units of the interface (ui.style.ui_scale)."""
FRAME_PX, TASK_BAR_PX = 16, 120
"""How much of the screen borders, title bar and task bars take from a maximised window."""
TITLE = "ClipGStream Studio"


def make_window(width: int, height: int, *, is_visible: bool = True) -> Any:
    """A window with the context everything here is written for.

    Eight bits per channel are asked for by name: the EGL default is a 16-bit format.
    """
    config = pyglet.gl.Config(
        major_version=3,
        minor_version=3,
        forward_compatible=True,
        double_buffer=True,
        red_size=8,
        green_size=8,
        blue_size=8,
        alpha_size=8,
        depth_size=24,
    )
    screen = pyglet.display.get_display().get_default_screen()
    if not pyglet.options.headless:
        width, height = min(width, screen.width), min(height, screen.height)
    window = pyglet.window.Window(
        width,
        height,
        caption=TITLE,
        resizable=True,
        vsync=False,
        config=config,
        visible=is_visible,
        file_drops=not pyglet.options.headless,
    )
    if not pyglet.options.headless:
        window.set_minimum_size(*(int(side) for side in MIN_UNITS))
    return window


def window_title(session: WindowSession) -> str:
    """The open project, how far it is trained and where it lies."""
    opened = session.project_status
    return TITLE if opened is None else one_line(f"{opened.name} - {opened.trained_text} - {opened.folder} - {TITLE}")


def screen_scale() -> float:
    """How many pixels the platform wants for what takes one on an ordinary screen: Xft.dpi / 96 on X11, the scale of
    the first screen on Windows. On macOS 1: there a window has more pixels than its size says."""
    if pyglet.options.headless or sys.platform == "darwin":
        return 1.0
    try:
        return float(pyglet.display.get_display().get_default_screen().get_dpi()) / 96.0
    except (NotImplementedError, ValueError, OSError):  # a platform, or a resource file, that does not say
        return 1.0


class StudioWindow:
    """One window on one session.

    Args:
        session: See app.session.session.Session; closed by `close`.
        width, height: Pixels of the screen; None takes the size it had before, else the default one.
        fixed_delta_s: Seconds per frame as reported to ImGui; tests fix it, None measures.
        memory: The window's earlier appearance; None starts afresh and keeps nothing.
        preferences: The user's preferences; None takes the defaults and keeps nothing.
    """

    def __init__(
        self,
        session: WindowSession,
        *,
        width: int | None = None,
        height: int | None = None,
        fixed_delta_s: float | None = None,
        memory: WindowMemory | None = None,
        preferences: PreferencesFile | None = None,
    ) -> None:
        self.session = session
        self._memory = memory
        scale = UiScale(None if memory is None else memory.ui_scale, of_screen=screen_scale())
        kept_size = None if memory is None else memory.size
        default = (round(DEFAULT_SIZE[0] * scale.wanted), round(DEFAULT_SIZE[1] * scale.wanted))
        size = kept_size or default if width is None or height is None else (width, height)
        self.window = make_window(*size)
        scale.of_screen *= self.window.get_framebuffer_size()[0] / max(self.window.get_size()[0], 1)
        if memory is not None and memory.is_maximized and width is None:
            self.window.maximize()
        self.ctx = moderngl.create_context(require=330)
        self.ctx.gc_mode = "context_gc"  # dropped objects wait for free_dropped() on this thread
        self.frame = Frame(
            self.window,
            self.ctx,
            session,
            fixed_delta_s=fixed_delta_s,
            on_input=self._answer_soon,
            memory=memory,
            scale=scale,
            preferences=preferences,
        )
        self._handlers = {
            "on_file_drop": self._file_dropped,
            "on_close": self._close_asked,
            "on_resize": self._resized,
            "on_expose": self._exposed,
            "on_show": self._exposed,
            PICTURE_EVENT: self._answer_soon,
        }
        type(self.window).register_event_type(PICTURE_EVENT)
        self.window.push_handlers(**self._handlers)
        session.wake_by(self._wake)
        self._is_closed = False
        self._is_running = False
        self._is_answer_due = False
        self._title = ""

    # ---- the loop --------------------------------------------------------------------------------------------

    def run(self) -> None:
        """Serve events and draw on demand until the window is closed."""
        previous = signal.signal(signal.SIGTERM, lambda *_: pyglet.app.exit())
        pyglet.clock.schedule_interval(self.tick, TICK_S)
        self._is_running = True
        try:
            pyglet.app.run(None)
        except KeyboardInterrupt:
            logger.info("Interrupted; closing")
        finally:
            self._is_running = False
            pyglet.clock.unschedule(self.tick)
            signal.signal(signal.SIGTERM, previous)

    def tick(self, dt_s: float) -> None:
        """Update the session; draw when something changed."""
        if self.frame.update(dt_s):
            self.draw()
        if self.frame.ui.quit_requested:
            pyglet.app.exit()
        if self.frame.ui.wishes.is_fullscreen:
            self.frame.ui.wishes.is_fullscreen = False
            self._switch_fullscreen()
        self._show_title()

    def _answer_soon(self) -> None:
        """Draw right after the events at hand, instead of up to a tick later."""
        if self._is_running and not self._is_answer_due:
            self._is_answer_due = True
            pyglet.clock.schedule_once(self._answer, 0.0)

    def _wake(self) -> None:
        """From any thread: a picture is there, do not wait for the next tick."""
        if self._is_running:
            pyglet.app.platform_event_loop.post_event(self.window, PICTURE_EVENT)

    def _answer(self, dt_s: float) -> None:
        self._is_answer_due = False
        self.tick(0.0)  # the regular tick counts the time

    def draw(self) -> None:
        """Draw one frame now."""
        self.window.switch_to()
        if self.frame.draw():
            self.window.flip()

    def settle(self, frames: int = 4, *, until_idle_s: float = 0.0) -> None:
        """Draw some frames without an event loop, for tests and pictures of the window.

        Args:
            until_idle_s: Go on this long at most while frames are still wanted.
        """
        deadline_s = time.perf_counter() + until_idle_s
        drawn = 0
        while drawn < frames or time.perf_counter() < deadline_s:
            if not self.frame.update(TICK_S) and drawn >= frames:
                break
            self.draw()
            drawn += 1

    def _switch_fullscreen(self) -> None:
        """Fill the screen, or go back to a window of the size before. Without a screen there is nothing to fill."""
        if not pyglet.options.headless:
            self.window.set_fullscreen(not self.window.fullscreen)
            self.frame.forget_shown()

    def _show_title(self) -> None:
        title = window_title(self.session)
        if title != self._title:
            self._title = title
            self.window.set_caption(title)

    # ---- events ----------------------------------------------------------------------------------------------

    def _file_dropped(self, x: int, y: int, paths: list[str]) -> None:
        if paths:
            self.frame.open_path(Path(paths[0]))

    def _close_asked(self) -> bool:
        pyglet.app.exit()
        return EVENT_HANDLED  # the default would close the window before GL objects are released

    def _resized(self, width: int, height: int) -> bool:
        self.frame.forget_shown()
        return EVENT_HANDLED

    def _exposed(self) -> None:
        self.frame.forget_shown()

    def _remember(self) -> None:
        if self._memory is not None and not self.window.fullscreen:
            self._memory.is_maximized = self._fills_screen()
            if not self._memory.is_maximized:  # else the size to go back to is the one before
                self._memory.size = self.window.get_size()
        self.frame.remembering.save(self.session)

    def _fills_screen(self) -> bool:
        """Is the window maximised? pyglet does not say; one that leaves no more than a task bar is taken for it."""
        if pyglet.options.headless:
            return False
        screen = pyglet.display.get_display().get_default_screen()
        width, height = self.window.get_size()
        return width >= screen.width - FRAME_PX and height >= screen.height - TASK_BAR_PX

    def close(self) -> None:
        """Stop the session, then release GL, ImGui and the window. Safe to call twice."""
        if self._is_closed:
            return
        self._is_closed = True
        self._remember()
        self.session.close()
        self.window.switch_to()
        self.frame.close()
        self.window.remove_handlers(**self._handlers)
        free_dropped(self.ctx)
        self.ctx.release()
        self.window.close()
