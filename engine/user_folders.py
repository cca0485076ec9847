"""Where this program keeps files of its own: the user's folders for data, configuration and cache, on every system.

On Linux the XDG variables decide. None of the folders need exist; whoever writes makes them.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Literal

from platformdirs import PlatformDirs

NAME = "ClipGStream"


def data_dir() -> Path:
    """The folder for files to keep: projects made without a place of their own, and logs."""
    return _folder("user_data_dir")


def config_dir() -> Path:
    """Preferences; on Windows they follow the user from one machine to the next."""
    return _folder("user_config_dir", roaming=True)


def cache_dir() -> Path:
    """The folder for files that can be made again."""
    return _folder("user_cache_dir")


def _folder(which: Literal["user_data_dir", "user_config_dir", "user_cache_dir"], *, roaming: bool = False) -> Path:
    # without opinion Windows gets no folder "Cache" inside ours
    dirs = PlatformDirs(NAME, appauthor=False, roaming=roaming, opinion=False)
    try:
        return Path(getattr(dirs, which))
    except RuntimeError:  # no home at all, as for some system users: a folder that cannot be made
        return Path(os.sep, "nonexistent", NAME)
