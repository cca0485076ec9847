"""AnchorRecord: all that a clip file holds of the anchors of one role, and how that is spread over named arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from engine.clip_files.array_names import INHERITED, OWN, REASONS
from engine.clip_files.roles import ROLES


class RecordError(ValueError):
    """Arrays of one role are missing, or do not fit together; names them. The text fits into brackets."""


@dataclass(frozen=True, slots=True)
class StoredAnchors:
    """Anchors as they are stored; see engine.model.anchors.AnchorSet. A value.

    Attributes:
        positions: Scene units. [A, 3]
        color_logits: [A, 3]
        features: [A, F]
        log_offset_scales, log_base_scales: Log of scene units. [A, 3]
        presence: Frames in which each exists; None for static ones. [A, M] bool
        birth_frames, velocities, accelerations: Of those that travel, see engine.model.motion.AnchorMotion; else None.
    """

    positions: np.ndarray
    color_logits: np.ndarray
    features: np.ndarray
    log_offset_scales: np.ndarray
    log_base_scales: np.ndarray
    presence: np.ndarray | None = None
    birth_frames: np.ndarray | None = None
    velocities: np.ndarray | None = None
    accelerations: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.positions)

    def joined(self, others: StoredAnchors) -> StoredAnchors:
        """These anchors, and others behind them. They travel if both do."""
        own, more = self.named(), others.named()
        shared = [kind for kind in own if kind in more]
        return StoredAnchors(**{kind: np.concatenate([own[kind], more[kind]]) for kind in shared})

    def named(self) -> dict[str, np.ndarray]:
        """The arrays that there are, by attribute."""
        return {kind: array for kind in _KINDS if (array := getattr(self, kind)) is not None}


_KINDS = tuple(attribute.name for attribute in fields(StoredAnchors))
_MOTION = ("birth_frames", "velocities", "accelerations")
_OPTIONAL = ("presence", *_MOTION)


@dataclass(frozen=True, slots=True)
class AnchorRecord:
    """A clip file's record of the anchors of one role. A value.

    Attributes:
        own: The anchors, where the clip itself stores them.
        presence: Of inherited anchors, the frames of this clip in which each exists. [A, M] bool
        is_hidden: Of inherited anchors, those that this clip leaves out. [A] bool
        light: Of inherited static anchors, log brightness at the clip's start and end. [A, 2]
        reasons: Why the gate decided so about each, codes of engine.gate.reasons. [A] uint8
    """

    own: StoredAnchors | None = None
    presence: np.ndarray | None = None
    is_hidden: np.ndarray | None = None
    light: np.ndarray | None = None
    reasons: np.ndarray | None = None

    def arrays(self, role: str) -> dict[str, np.ndarray]:
        """By the names that they have in a file. Inverse of `read_records`."""
        own = {} if self.own is None else self.own.named()
        named = {f"{OWN}.{role}.{kind}": array for kind, array in own.items()}
        said = {
            f"{INHERITED}.{role}.presence": self.presence,
            f"{INHERITED}.{role}.is_hidden": self.is_hidden,
            f"{INHERITED}.{role}.light": self.light,
            f"{REASONS}.{role}": self.reasons,
        }
        return named | {name: array for name, array in said.items() if array is not None}


def read_records(arrays: Mapping[str, np.ndarray]) -> dict[str, AnchorRecord]:
    """The anchor records in the arrays of a clip, by role, in the order in which roles are decoded.

    Raises:
        RecordError: Arrays of one role are missing, or do not fit together.
    """
    parts: dict[str, dict[tuple[str, str], np.ndarray]] = {}
    for name, array in arrays.items():
        group, _, rest = name.partition(".")
        if group in (OWN, INHERITED, REASONS):
            role, _, kind = rest.partition(".")
            parts.setdefault(role, {})[group, kind] = array
    unknown = parts.keys() - set(ROLES)
    if unknown:
        raise RecordError(f"there is no role of anchors called {min(unknown)}")
    return {role: _record(role, parts[role]) for role in ROLES if role in parts}


def _record(role: str, found: Mapping[tuple[str, str], np.ndarray]) -> AnchorRecord:
    own = {kind: array for (group, kind), array in found.items() if group == OWN}
    return AnchorRecord(
        own=_stored(role, own) if own else None,
        presence=found.get((INHERITED, "presence")),
        is_hidden=found.get((INHERITED, "is_hidden")),
        light=found.get((INHERITED, "light")),
        reasons=found.get((REASONS, "")),
    )


def _stored(role: str, own: Mapping[str, np.ndarray]) -> StoredAnchors:
    wanted = _KINDS if any(kind in own for kind in _MOTION) else [kind for kind in _KINDS if kind not in _OPTIONAL]
    missing = [kind for kind in wanted if kind not in own]
    if missing:
        raise RecordError(f"its {role} anchors have no {missing[0]}")
    n_rows = {kind: len(array) for kind, array in own.items()}
    if len(set(n_rows.values())) > 1:
        raise RecordError(f"its {role} anchors have different numbers of rows: {n_rows}")
    return StoredAnchors(**{kind: own[kind] for kind in _KINDS if kind in own})
