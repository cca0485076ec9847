"""The rule that a part of the window which cannot be drawn costs a notice, not the window.

Whatever the part has begun and not ended is ended for it, so that what comes after it is drawn as always.
"""

from __future__ import annotations

import logging
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from imgui_bundle import imgui, implot

from app.session.notices import Notice, Notices
from ui.panels.pieces.widgets import text_warning

logger = logging.getLogger(__name__)

GOES_ON = "The rest of the window still works. This is a bug in the program: copy this text and report it."


class Guard:
    """Which parts of the window fail at present, and the notice about each.

    Args:
        notices: Of the session.
        on_failure: Called when a new failure was reported.
    """

    def __init__(self, notices: Callable[[], Notices], on_failure: Callable[[], None]) -> None:
        self._notices, self._on_failure = notices, on_failure
        self._failing: set[str] = set()
        self._told: dict[str, Notice] = {}

    def draw(self, part: str, draw_part: Callable[[], None]) -> bool:
        """Draw one part of the frame. A popup in which it fails is closed, lest an empty one is in the way.

        Args:
            part: Its name in a sentence, such as "the panel Timeline".
        Returns:
            Whether it could be drawn. If not, the user has been notified.
        """
        stack = imgui.internal.ErrorRecoveryState()
        imgui.internal.error_recovery_store_state(stack)
        draw = imgui.internal.get_current_window_read().draw_list
        n_clips, alpha = len(draw._clip_rect_stack), imgui.get_style().alpha
        try:
            draw_part()
        except Exception as error:  # noqa: BLE001 - the edge of the frame loop, which continues
            traceback.clear_frames(error.__traceback__)  # objects held there may end while that is still possible
            _recover(stack)
            while len(draw._clip_rect_stack) > n_clips:
                draw.pop_clip_rect()
            imgui.get_style().alpha = alpha  # Dear ImGui leaves 0 after begin_disabled(False), and nothing is seen
            self._tell(part, error, f"Error in {part}")
            return False
        self._failing.discard(part)
        return True

    @contextmanager
    def telling(self, part: str, title: str) -> Iterator[None]:
        """For what is done between two frames: a failure ends here and is reported."""
        try:
            yield
        except Exception as error:  # noqa: BLE001 - the edge of the loop between frames
            self._tell(part, error, title)
        else:
            self._failing.discard(part)

    def is_failing(self, part: str) -> bool:
        """Did a part fail when it was drawn last?"""
        return part in self._failing

    def _tell(self, part: str, error: Exception, title: str) -> None:
        """Notify the user, and the log, of a failure: once until the part works again, and never before the user has
        dismissed the earlier notice."""
        is_new = part not in self._failing and self._told.get(part) not in list(self._notices())
        self._failing.add(part)
        if is_new:
            logger.error("%s", title, exc_info=error)
            self._told[part] = self._notices().add("error", title, f"{type(error).__name__}: {error}", GOES_ON)
            self._on_failure()


def draw_failed(part: str) -> None:
    """In place of a part that could not be drawn: that it is so."""
    text_warning(f"{part[0].upper()}{part[1:]} cannot be drawn. See the log for the reason.")


def _recover(stack: imgui.internal.ErrorRecoveryState) -> None:
    """End windows, tables, groups and plots that the failed part left open, and go back to the styles before it."""
    context = imgui.get_current_context()
    n_popups = stack.size_of_begin_popup_stack
    is_in_popup = len(context.begin_popup_stack) > n_popups
    plots = implot.get_current_context()
    implot.internal.reset_ctx_for_next_plot(plots)
    implot.internal.reset_ctx_for_next_aligned_plots(plots)
    with _quiet():
        imgui.internal.error_recovery_try_to_recover_state(stack)
    context.next_window_data.clear_flags()
    context.next_item_data.clear_flags()
    if is_in_popup and len(context.open_popup_stack) > n_popups:
        imgui.internal.close_popup_to_level(n_popups, True)


@contextmanager
def _quiet() -> Iterator[None]:
    """While this lasts, Dear ImGui says nothing about what it has to end: it would raise at the first such thing, or
    follow the pointer with a message for programmers, and fill the terminal."""
    io = imgui.get_io()
    names = ("assert", "tooltip", "debug_log")
    before = {name: getattr(io, f"config_error_recovery_enable_{name}") for name in names}
    for name in names:
        setattr(io, f"config_error_recovery_enable_{name}", False)
    try:
        yield
    finally:
        for name, value in before.items():
            setattr(io, f"config_error_recovery_enable_{name}", value)
