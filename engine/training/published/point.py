"""Point: one thing on which the published method can be described, and whom `--preset paper` follows there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from engine.setting import Value

Follows = Literal["both", "paper", "released code", "neither"]


@dataclass(frozen=True, slots=True)
class Point:
    """One point on which the method can be described.

    Attributes:
        name: Short and unique.
        follows: Whom the preset follows there.
        paper: The paper's statement; empty where it is silent.
        released: The behaviour of the released code; empty where it does as the paper says.
        here: The behaviour here; empty where that is as `follows` says.
        reason: Why this differs from the paper or the released code; empty where it does not.
        settings: Values in the preset that make it so.
    """

    name: str
    follows: Follows
    paper: str = ""
    released: str = ""
    here: str = ""
    reason: str = ""
    settings: Mapping[str, Value] = field(default_factory=dict)

    @property
    def is_difference(self) -> bool:
        """Whether the paper or the released code has it otherwise."""
        return bool(self.reason)
