"""USD's own library, which is an extra: asked for only where USD is written or read."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType

from engine.errors import ProjectError


def usd_module(name: str) -> ModuleType:
    """A module of pxr, such as "Usd" or "UsdGeom".

    Raises:
        ProjectError: The library is not installed.
    """
    try:
        return import_module(f"pxr.{name}")
    except ImportError as error:
        raise ProjectError(
            f"USD needs the library usd-core, which is not installed ({error}).",
            hint="Install it with: pip install 'clipgstream[usd]'",
        ) from error


@contextmanager
def writing_usd() -> Iterator[None]:
    """In this block, what USD cannot write is an OSError.

    Raises:
        ProjectError: The library is not installed.
        OSError: USD cannot write.
    """
    Tf = usd_module("Tf")
    try:
        yield
    except Tf.ErrorException as error:
        first = next(iter(error.args), None)  # of many, each with a place in the library's own code
        raise OSError(f"USD: {getattr(first, 'commentary', 'no reason is given')}") from error
