"""The Python API of ClipGStream Studio, under the name of the program: everything that app.scripting offers.

In the repository the packages of the program lie next to this file. In an installed program they lie below it, and
this is the package's `__init__.py` (setup.py); child processes import it, so the API itself comes with its first use.
"""

import sys
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from app.scripting import *  # noqa: F403
    from app.scripting import __all__ as __all__

_HERE = Path(__file__).resolve().parent
_ABOVE = f"{__name__}." if "__path__" in globals() else ""


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


if not _ABOVE:
    for _name in ("engine", "app"):
        _import_own(_name)


def __getattr__(name: str) -> Any:
    """A name of the API, or `__all__`. Raises AttributeError."""
    if name != "__all__" and name.startswith("__"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{_ABOVE}app.scripting"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__getattr__("__all__")})


def main() -> int:
    """The program `clipgstream`, with the arguments of the process. Returns its exit code."""
    if not _ABOVE:
        _import_own("ui")
    return int(import_module(f"{_ABOVE}ui.main").main())
