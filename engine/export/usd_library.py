"""USD's own library, which is an extra: asked for only where USD is written or read."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType
from typing import Any

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


def state_unit(stage: Any, meters_per_unit: float | None) -> None:
    """Write into a stage how long its unit is, m. Where that is not known, a unit counts as a metre, as in our add-on
    for Blender: without a statement USD takes it for a centimetre. Raises ProjectError: The library is missing."""
    usd_module("UsdGeom").SetStageMetersPerUnit(stage, meters_per_unit or 1.0)


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
