"""The table of back ends, and the one place where one is chosen, once per process. Imports no torch.

Whoever owns a process says by `choose_backend` which one it computes with; what is computed in it is handed
`process_backend()`. A back end belongs to the machine: no project, and nothing that is kept of one, names it.
"""

from __future__ import annotations

import logging
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

from engine.errors import ProjectError
from engine.own_modules import import_own

if TYPE_CHECKING:
    import torch

    from engine.backends.backend import Backend

logger = logging.getLogger(__name__)


class BackendEntry(NamedTuple):
    """A back end in the table.

    Attributes:
        place: Module and class, "package.module:Class"; imported when it is asked for.
        words: A description, for help texts.
        has_devices: Whether it is made for a device that may be named behind it, as in "reference:cpu".
    """

    place: str
    words: str
    has_devices: bool = False


AUTO = "auto"
"""The first of the table that works on this machine."""
BACKENDS = {
    "cpu": BackendEntry("engine.backends.cpu.backend:CpuBackend", "compiled kernels on the CPU"),
    "reference": BackendEntry(
        "engine.backends.reference.backend:ReferenceBackend", "plain torch, many times slower", has_devices=True
    ),
}
"""By name, the best one first."""
_chosen = AUTO


@cache
def backend_called(name: str) -> Backend:
    """The back end of this name, which may be followed by a device: "cpu", "reference", "reference:cuda".

    Raises:
        ProjectError: There is none, or it does not work on this machine.
    """
    entry, device = _entry(name)
    module, _, kind = entry.place.partition(":")
    make = getattr(import_own(module), kind)
    try:
        backend: Backend = make(device=_device(device)) if device else make()
    except RuntimeError as error:  # torch has no device of that name
        raise ProjectError(f"Back end {name!r} does not exist.", hint=_hint()) from error
    if not backend.is_available():
        raise ProjectError(f"Back end {name!r} does not work on this machine.", hint=_hint())
    return backend


def choose_backend(name: str) -> None:
    """Say what this process computes with, before it computes: the name of a back end or AUTO.

    Raises:
        ProjectError: There is none of this name.
    """
    global _chosen
    if name != AUTO:
        _entry(name)
    _chosen = name


def chosen_name() -> str:
    """The choice given to `choose_backend`, for the jobs of child processes."""
    return _chosen


def process_backend() -> Backend:
    """The back end of this process.

    Raises:
        ProjectError: The chosen one does not work on this machine, or none does.
    """
    return _best() if _chosen == AUTO else backend_called(_chosen)


@cache
def _best() -> Backend:
    for name in BACKENDS:
        try:
            return backend_called(name)
        except (ProjectError, ImportError) as error:
            logger.info("back end %s is skipped: %s", name, error)
    raise ProjectError("No back end works on this machine.", hint="`clipgstream doctor` shows what is missing.")


def _entry(name: str) -> tuple[BackendEntry, str]:
    """Row and device of a name."""
    kind, _, device = name.partition(":")
    entry = BACKENDS.get(kind)
    if entry is None or (":" in name and not (device and entry.has_devices)):
        raise ProjectError(f"Back end {name!r} does not exist.", hint=_hint())
    return entry, device


def _device(name: str) -> torch.device:
    import torch

    return torch.device(name)


def backend_names() -> str:
    """The choices besides AUTO, as they are written."""
    return ", ".join(f"{name}[:DEVICE]" if entry.has_devices else name for name, entry in BACKENDS.items())


def _hint() -> str:
    return f"Choose {AUTO}, {backend_names()}."
