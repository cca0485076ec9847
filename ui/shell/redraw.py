"""When the window has to be drawn: after input and news, and from then on until two frames in a row are the same.

ImGui needs several frames to finish: it takes in a press and its release one after the other, measures a menu before it
shows it, and gives docked panels their tabs a frame later. How many that are depends on what was opened, so they are
not counted but compared. Knows nothing of GL and of the session.
"""

from __future__ import annotations

import ctypes
import zlib

from imgui_bundle import imgui

FRAMES_AFTER_INPUT = 3
"""A new capture is first measured and not drawn: two frames that are the same do not mean that it is done."""
FRAMES_AFTER_CHANGE = 2
"""Each frame that differs from the one before asks for this many more."""
MAX_SETTLING = 24
"""Frames without news or input after which something that never stands still is left alone."""


def fingerprint(draw_data: imgui.ImDrawData) -> int:
    """A number that differs whenever what ImGui draws does: corners, colours, order and textures."""
    value = 0
    for commands in draw_data.cmd_lists:
        value = hash((value, *(command.tex_ref.get_tex_id() for command in commands.cmd_buffer)))
        corners, indices = commands.vtx_buffer, commands.idx_buffer
        for buffer, size in ((corners, imgui.VERTEX_SIZE), (indices, imgui.INDEX_SIZE)):
            if buffer.size():
                raw = (ctypes.c_char * (buffer.size() * size)).from_address(buffer.data_address())
                value = zlib.crc32(raw, value & 0xFFFFFFFF)
    return value


class RedrawPlan:
    """Counts the frames that are still to be drawn."""

    def __init__(self) -> None:
        self._wanted = 0
        self._settling = 0
        self._shown: int | None = None

    @property
    def is_due(self) -> bool:
        """Is a frame to be drawn now?"""
        return self._wanted > 0

    def request(self, frames: int = FRAMES_AFTER_INPUT) -> None:
        """Draw at least this many frames from now on: something happened."""
        self._wanted = max(self._wanted, frames)
        self._settling = 0

    def note_drawn(self, drawn: int, *, has_more_input: bool = False) -> None:
        """One frame was drawn.

        Args:
            drawn: Its fingerprint.
            has_more_input: Input waits that ImGui takes in with the next frame.
        """
        self._wanted = max(self._wanted - 1, 0)
        self._settling += 1
        has_changed, self._shown = drawn != self._shown, drawn
        if has_more_input:
            self.request()
        elif has_changed and self._settling < MAX_SETTLING:
            self._wanted = max(self._wanted, FRAMES_AFTER_CHANGE)
