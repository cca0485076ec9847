"""The table of back ends, and the one place where one is chosen. Imports no torch."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING

from engine.errors import ProjectError

if TYPE_CHECKING:
    from engine.backends.backend import Backend

DEFAULT = "cpu"
BACKENDS = {
    "cpu": "engine.backends.cpu.backend:CpuBackend",
    "reference": "engine.backends.reference.backend:ReferenceBackend",
}
"""Name to module and class, which is imported when it is asked for."""


@cache
def backend_called(name: str = DEFAULT) -> Backend:
    """The back end of this name.

    Raises:
        ProjectError: There is none.
    """
    if name not in BACKENDS:
        raise ProjectError(f"Back end {name!r} does not exist.", hint=f"Choose one of {', '.join(BACKENDS)}.")
    module, _, kind = BACKENDS[name].partition(":")
    return getattr(import_module(module), kind)()
