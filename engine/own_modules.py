"""Our own modules by the names that strings give them, such as "app.export.player_job".

In the repository `app`, `engine` and `ui` are packages of their own. In an installed program they lie in the package
`clipgstream`, where importing them disturbs no other package of these names, and imports were rewritten when it was
built (setup.py). Strings were not: they name modules as the repository does, and whoever imports by them asks here.
"""

from __future__ import annotations

import os
from importlib import import_module
from pathlib import Path
from types import ModuleType

_ABOVE = __name__.removesuffix("engine.own_modules")
"""Empty, or "clipgstream."."""
_PACKAGES = ("app", "engine", "ui")


def module_name(name: str) -> str:
    """The name under which a module is imported here; one of another program keeps its name."""
    return f"{_ABOVE}{name}" if name.partition(".")[0] in _PACKAGES else name


def import_own(name: str) -> ModuleType:
    """Import a module by its name in the repository. Raises ImportError."""
    return import_module(module_name(name))


def program_version() -> str:
    """Version of this program; "unknown" where it runs without being installed."""
    import importlib.metadata  # which takes longer than all of this file

    try:
        return importlib.metadata.version("clipgstream")
    except importlib.metadata.PackageNotFoundError:
        return "unknown"


def python_path() -> str:
    """PYTHONPATH of a process that is to import our modules as this one does, with that of this process behind."""
    root = Path(__file__).resolve().parents[__name__.count(".")]
    return os.pathsep.join(filter(None, (str(root), os.environ.get("PYTHONPATH"))))
