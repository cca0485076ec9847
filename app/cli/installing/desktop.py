"""The program in the menu of a Linux desktop: an entry, an icon and kinds of files, in the user's own data folder.

As freedesktop.org describes them, so that GNOME, KDE, Xfce and others find them. No other file is touched.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

from engine.assets import asset_path
from engine.errors import ProjectError
from engine.own_modules import module_name
from engine.storage.files import atomic_path, disk_error
from engine.user_folders import data_dir

ENTRY = Path("applications", "clipgstream.desktop")
ICON = Path("icons", "hicolor", "scalable", "apps", "clipgstream.svg")
KINDS = Path("mime", "packages", "clipgstream.xml")
"""Kinds of files that the program opens and hardly another one."""
MIME_TYPES = ("application/x-4dgs", "application/x-tsog")
"""Those that it declares."""
_REFRESHING = (
    ("update-mime-database", "mime"),
    ("update-desktop-database", "applications"),
    ("gtk-update-icon-cache", "-q", "-t", "icons/hicolor"),
)
"""Programs that make a desktop notice at once, with folders; one that is not there is not needed."""
_TIME_LIMIT_S = 20.0


def install() -> list[Path]:
    """Write everything, over what an earlier call wrote. Returns the files.

    Raises:
        ProjectError: This is not Linux.
        DiskError: The disk refuses.
    """
    contents = {
        ENTRY: desktop_entry(program_words()).encode(),
        ICON: asset_path("desktop", "clipgstream.svg").read_bytes(),
        KINDS: asset_path("desktop", "clipgstream.xml").read_bytes(),
    }
    written = []
    for place, content in contents.items():
        path = _data_home() / place
        try:
            with atomic_path(path) as partial:
                partial.write_bytes(content)
        except OSError as error:
            raise disk_error(error, what="The menu entry", path=path) from error
        written.append(path)
    _refresh()
    return written


def remove() -> list[Path]:
    """Remove what `install` wrote. Returns the files that were there.

    Raises:
        ProjectError: This is not Linux.
        DiskError: The disk refuses.
    """
    removed = []
    for place in (ENTRY, ICON, KINDS):
        path = _data_home() / place
        try:
            path.unlink()
        except FileNotFoundError:
            continue
        except OSError as error:
            raise disk_error(error, what="The menu entry", path=path) from error
        removed.append(path)
    if removed:
        _refresh()
    return removed


def desktop_entry(words: list[str]) -> str:
    """The text of the entry. words: The program and its first arguments."""
    return f"""\
[Desktop Entry]
Type=Application
Name=ClipGStream Studio
GenericName=Studio for dynamic 3D scenes
Comment=Trains and shows dynamic 3D Gaussian scenes from multi-camera video
Exec={" ".join(map(_quoted, words))} %f
TryExec={_as_string(words[0])}
Icon={ICON.stem}
Terminal=false
StartupNotify=false
Categories=Graphics;3DGraphics;
MimeType={"".join(f"{name};" for name in MIME_TYPES)}
Keywords=gaussian;splatting;capture;volumetric;video;
"""


def program_words() -> list[str]:
    """How this program is started from anywhere: its script, or Python with its module."""
    script = shutil.which(sys.argv[0])
    if script is not None and Path(script).suffix != ".py":
        return [str(Path(script).absolute())]
    return [sys.executable, "-P", "-m", module_name("ui")]


def _quoted(word: str) -> str:
    """An argument of Exec: quoted as for a shell, then escaped as every string of the file; % begins a field code."""
    for sign in '\\"`$':
        word = word.replace(sign, f"\\{sign}")
    return _as_string(f'"{word}"').replace("%", "%%")


def _as_string(text: str) -> str:
    return text.replace("\\", "\\\\").replace("\n", "\\n")


def _data_home() -> Path:
    if not sys.platform.startswith("linux"):
        raise ProjectError("Only Linux desktops have such entries.", hint="Pin the program to the task bar instead.")
    return data_dir().parent


def _refresh() -> None:
    for program, *options, folder in _REFRESHING:
        with suppress(OSError, subprocess.SubprocessError):
            command = [program, *options, str(_data_home() / folder)]
            subprocess.run(command, capture_output=True, timeout=_TIME_LIMIT_S, check=False)
