"""ChildKind: the declaration of a kind of child process; what it is asked, hears, reports and answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Generic, Literal, TypeVar, cast

from engine.own_modules import import_own
from engine.progress import Progress

Job = TypeVar("Job")
Event = TypeVar("Event")
Result = TypeVar("Result")
STALL_S = 300.0
"""A child that has used no processor time for so long hangs."""
Priority = Literal["normal", "lower", "idle"]


class ChildFailed(Exception):
    """A child gave no result: it could not be started, was killed, hung, or failed. Says why, without a full stop.

    Attributes:
        is_final: Whether it would be so again.
    """

    def __init__(self, reason: str, *, is_final: bool) -> None:
        super().__init__(reason)
        self.is_final = is_final


class Unwanted(Exception):
    """Raised in a child once nobody waits for its result."""


@dataclass(frozen=True, slots=True)
class ChildKind(Generic[Job, Event, Result]):
    """One kind of child process. A constant of a module.

    Attributes:
        place: Of this constant, as "module:NAME"; the child imports it from there.
        work: "module:function" that is called with the job and the child's `Parent`, and returns the result. Only the
            child imports it.
        what: Its name in reasons, as "the process that mends".
        job, event, result, command: Types of what crosses, as msgspec decodes them, or "module:name" of one that is
            imported when it comes.
        priority: How the child competes for cores.
        grace_s: A child that is no longer wanted may tidy up for so long, and one whose parent has died for as long
            as it takes; with 0 it ends at once.
        stall_s: Seconds without any work after which it is taken for hung; None for never. Time alone never decides:
            results would depend on what else the machine does.
        is_spreading: Whether it spreads work over cores itself: matrix products then take one thread each, and sums
            keep their order on any machine.
    """

    place: str
    work: str
    what: str
    job: object
    result: object = None
    event: object = Progress
    command: object = None
    priority: Priority = "normal"
    grace_s: float = 0.0
    stall_s: float | None = None
    is_spreading: bool = False


def find(place: str) -> Any:
    """The object at "module:name"."""
    module, _, name = place.partition(":")
    return cast("Any", getattr(import_own(module), name))
