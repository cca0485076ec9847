"""The type of the fixture `keep`."""

from __future__ import annotations

from typing import Protocol, TypeVar


class Releasable(Protocol):
    """Anything that owns GL objects."""

    def release(self) -> None: ...


Thing = TypeVar("Thing", bound=Releasable)


class Keep(Protocol):
    """Hands its argument back and releases it after the test."""

    def __call__(self, thing: Thing) -> Thing: ...
