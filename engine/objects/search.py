"""ObjectSearch: the walk from clip to clip that says of each part how far it belongs to an object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import csr_matrix

from engine.editing.scene_object import Doubt
from engine.objects.appearance import Appearance, appearance_of, looks_like
from engine.objects.belonging import belonging
from engine.objects.carrying import carried
from engine.objects.moving_parts import MovingParts
from engine.objects.neighbours import bonds
from engine.objects.returning import returned

SAID, UNSAID, BEFORE = 1.0, 0.4, 0.3
"""Weight of parts that somebody has selected, of those that were not selected along with them, and of what was known
of a clip before it was corrected. Parts at the border of a clip weigh 1 at most."""
SEEN, UNSEEN = 1.0, 0.12
"""Weight of parts that were not selected, where the picture is known: those that were seen in it, and others."""
CORRECTED = 3.0
"""Weight of a correction against the same."""
COLOR = 0.3
"""Weight of a colour that only the object has, where everything else leaves it open whether a part belongs to it."""
OPAQUE = 0.4
"""What is fainter is easily overlooked when somebody selects."""
DECIDED = 3.0
"""How much values are driven apart before they are carried on."""
LEAST_SHARE = 0.12
"""An object with less of its former mass than this is gone."""


@dataclass(slots=True, eq=False)
class SearchGround:
    """A clip while it is searched.

    Attributes:
        parts: What moves in it.
        bonds: How that hangs together. [N, N]
        values: How far each part belongs to the object, 0..1. [N]
        surety: How sure that is, 0..1.
        doubt: Why it is not.
    """

    parts: MovingParts
    bonds: csr_matrix = field(init=False)
    values: np.ndarray = field(init=False)
    surety: float = 0.0
    doubt: Doubt = ""

    def __post_init__(self) -> None:
        self.bonds, self.values = bonds(self.parts), np.zeros(len(self.parts))

    @property
    def mass(self) -> float:
        """Of the object in its best frame."""
        return float((self.parts.opacities * self.parts.sizes**2 * (self.values > 0.5)).sum(1).max(initial=0.0))


class ObjectSearch:
    """The walk over the clips. What somebody has said is taken in one after the other, as it was said.

    Args:
        grounds: The clips, by time.
    """

    def __init__(self, grounds: Sequence[SearchGround]) -> None:
        self._grounds = grounds
        self._seeded: list[int] = []
        self._known_as: tuple[Appearance, Appearance] | None = None  # the object, and what else moves

    def take(
        self,
        place: int,
        frame_index: int,
        added: np.ndarray,
        removed: np.ndarray,
        seen: np.ndarray | None = None,
    ) -> None:
        """Take in what somebody has said of a clip, and carry it on, in both directions.

        Args:
            place: Of the clip among the grounds.
            frame_index: The frame that was looked at.
            added, removed: Parts that belong to the object, and that do not. [N] bool
            seen: Parts that could be selected in the picture that was looked at; None where that is not known.
        """
        ground = self._grounds[place]
        unsaid = UNSAID if seen is None else np.where(seen, SEEN, UNSEEN)
        said, weight = added.astype(np.float64), unsaid * _shown(ground.parts, frame_index)
        if self._seeded:  # a correction: what it leaves out stays as it was
            said, weight = ground.values.copy(), np.full(len(added), BEFORE)
            said[added] = 1.0
        said[removed] = 0.0
        weight[added | removed] = CORRECTED if self._seeded else SAID
        values = belonging(ground.bonds, said, weight, ground.values)
        self._known_as = appearance_of(ground.parts, values), appearance_of(ground.parts, 1.0 - values)
        ground.values = self._by_color(ground, values, said, weight)
        ground.surety, ground.doubt = 1.0, ""
        for step in (1, -1):
            self._carry(place, step)
        self._seeded.append(place)

    def _carry(self, origin: int, step: int) -> None:
        """From one clip on, in one direction, up to the next clip of which somebody has said something."""
        stops = [place for place in self._seeded if (place - origin) * step > 0]
        stop = min(stops, key=lambda place: abs(place - origin), default=None)
        end = (len(self._grounds) if step > 0 else -1) if stop is None else stop
        last_there = origin
        for place in range(origin + step, end, step):
            ground, before = self._grounds[place], self._grounds[place - step]
            said, surety = carried(before.parts, _decided(before.values), ground.parts)
            values = self._by_color(ground, belonging(ground.bonds, said, surety, said), said, surety)
            if stop is not None:  # the other seed has been here before
                near = abs(place - stop) / abs(stop - origin)
                values = near * values + (1.0 - near) * ground.values
            ground.values, ground.doubt = values, ""
            ground.surety = _surety(ground, surety)
            if ground.mass < LEAST_SHARE * self._grounds[last_there].mass:
                self._lose_or_regain(ground, surety)
            if ground.doubt != "gone":
                last_there = place

    def _by_color(self, ground: SearchGround, values: np.ndarray, said: np.ndarray, weight: np.ndarray) -> np.ndarray:
        """The same, with colours deciding where bonds leave it open: a ball is near the hand, but not like it."""
        assert self._known_as is not None
        like = looks_like(ground.parts, *self._known_as)
        clear = np.maximum(2.0 * np.abs(2.0 * like - 1.0) - 1.0, 0.0)
        by_color = COLOR * clear * 4.0 * values * (1.0 - values)
        total = np.maximum(weight + by_color, 1e-12)
        return belonging(ground.bonds, (weight * said + by_color * like) / total, total, values)

    def _lose_or_regain(self, ground: SearchGround, surety: np.ndarray) -> None:
        """Of a clip in which little of the object was found: it has left, or something like it has come."""
        assert self._known_as is not None
        found = returned(ground.parts, ground.bonds, surety, self._known_as[0])
        if found is None:
            ground.doubt = "gone"
        else:
            ground.values, ground.surety = np.maximum(ground.values, found.is_in), found.likeness
            ground.doubt = "returning"


def _decided(values: np.ndarray) -> np.ndarray:
    """Values nearer to yes or no, so that doubt does not grow from clip to clip. [N]"""
    return np.clip(0.5 + DECIDED * (values - 0.5), 0.0, 1.0)


def _shown(parts: MovingParts, frame_index: int) -> np.ndarray:
    """How far each part could be selected in a frame: not where it does not exist then, less where it is faint. [N]"""
    nearest = int(np.abs(np.asarray(parts.frames) - frame_index).argmin())
    return np.minimum(parts.opacities[nearest] / OPAQUE, 1.0).astype(np.float64)


def _surety(ground: SearchGround, surety: np.ndarray) -> float:
    """How clearly the parts of a clip are in or out, by the border that says so. surety: See `carried`. [N]"""
    mass, values = ground.parts.mass, ground.values
    concerned = values > 0.1
    if not concerned.any():
        return 1.0
    shares = mass[concerned] / max(mass[concerned].sum(), 1e-12)
    clear = float((shares * np.abs(2 * values[concerned] - 1)).sum())
    at_border = concerned & (surety > 0)
    if not at_border.any():
        return 0.0
    matched = float((mass * surety)[at_border].sum() / max(mass[at_border].sum(), 1e-12))
    return clear * matched
