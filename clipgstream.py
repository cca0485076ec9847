"""The Python API of ClipGStream Studio, under the name of the program: everything that app.scripting offers."""

import sys
from importlib import import_module
from pathlib import Path

_HERE = Path(__file__).resolve().parent


def _import_own(name: str) -> None:
    """Import a package of the program from beside this file: a script's own folder, which Python searches first, may
    have one of that name. Raises ImportError where the other one was imported before."""
    sys.path.insert(0, str(_HERE))
    try:
        found = import_module(name)
    finally:
        sys.path.remove(str(_HERE))
    folder = Path(next(iter(getattr(found, "__path__", [str(found.__file__)])))).resolve()
    if folder != (_HERE / name).resolve():
        raise ImportError(
            f"Another package called '{name}' is in use, so that ClipGStream Studio cannot use its own. Rename it, "
            f"or import clipgstream first in a script that does not need the other one - {folder}"
        )


for _name in ("engine", "app"):
    _import_own(_name)

from app.scripting import *  # noqa: E402, F403 - the same names, once it is known whose they are
from app.scripting import __all__ as __all__  # noqa: E402
