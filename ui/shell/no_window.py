"""The message where no window can be opened: OpenGL is too old or missing, or the display does not answer. In plain
words, without a traceback. Imports no window library: it may be that one which is broken.
"""

from __future__ import annotations

import logging
import os
import sys

logger = logging.getLogger(__name__)

EXIT_NO_WINDOW = 1
_OF_DISPLAY = {"NoSuchDisplayException"}
_OF_OPENGL = {"ContextException", "NoSuchConfigException", "GLException", "MissingFunctionException"}
HINT = (
    "`clipgstream doctor` reports what this machine has. Training, eval and render work without a window: "
    "see `clipgstream --help`."
)


def reason(error: BaseException) -> str:
    """Why there is no window, as a sentence; empty for an error that is a bug in the program.

    Args:
        error: The error raised by making the window.
    """
    names = {kind.__name__ for kind in type(error).__mro__}
    modules = {kind.__module__.partition(".")[0] for kind in type(error).__mro__}
    if names & _OF_DISPLAY:
        display = os.environ.get("DISPLAY", "")
        return f"The display {display} does not answer." if display else "No display found."
    if names & _OF_OPENGL or modules & {"moderngl", "_moderngl"}:
        return f"The graphics driver offers no OpenGL 3.3, which the window needs ({error})."
    if isinstance(error, ImportError):
        return f"A library that the window needs is missing ({error})."
    return ""


def tell(why: str) -> int:
    """Say it on the terminal, and in a dialog of the desktop where the program was not started from one.

    Returns:
        The exit code of the program.
    """
    sys.stderr.write(f"No window can be opened. {why}\n{HINT}\n")
    if not sys.stderr.isatty():
        _show_dialog(f"No window can be opened. {why}")
    return EXIT_NO_WINDOW


def _show_dialog(text: str) -> None:
    try:
        from imgui_bundle import portable_file_dialogs as native

        from ui.shell.dialogs.dialogs import has_native_dialog

        if has_native_dialog():
            native.message("ClipGStream Studio", text, native.choice.ok, native.icon.error).result()
    except Exception:  # the edge of the program: it ends anyway, and the reason was said
        logger.debug("no dialog could be shown", exc_info=True)
