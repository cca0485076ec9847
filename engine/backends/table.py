"""The table of back ends, and the one place where one is chosen. Imports no torch."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple

from engine.errors import ProjectError

if TYPE_CHECKING:
    from engine.backends.backend import Backend


class Entry(NamedTuple):
    """A back end in the table.

    Attributes:
        place: Module and class, "package.module:Class"; imported when it is asked for.
        words: What it is, for help texts.
    """

    place: str
    words: str


DEFAULT = "cpu"
BACKENDS = {
    "cpu": Entry("engine.backends.cpu.backend:CpuBackend", "compiled kernels"),
    "reference": Entry("engine.backends.reference.backend:ReferenceBackend", "plain torch, many times slower"),
}
"""By name, the default one first."""


@cache
def backend_called(name: str = DEFAULT) -> Backend:
    """The back end of this name.

    Raises:
        ProjectError: There is none.
    """
    if name not in BACKENDS:
        raise ProjectError(f"Back end {name!r} does not exist.", hint=f"Choose one of {', '.join(BACKENDS)}.")
    module, _, kind = BACKENDS[name].place.partition(":")
    return getattr(import_module(module), kind)()
