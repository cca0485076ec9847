"""USD's own library, which is an extra: asked for only where USD is written or read."""

from __future__ import annotations

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
