"""Clips without some of their anchors, as the arrays of their files."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from msgspec.structs import replace

from engine.clip_files.anchor_record import AnchorRecord, StoredAnchors
from engine.clip_files.array_names import is_said_of_anchors, own_kind
from engine.clip_files.clip_state import ClipState
from engine.clip_files.roles import STATIC
from engine.clip_files.stored_gaussians import read_stored
from engine.errors import ProjectError

Chosen = Mapping[str, np.ndarray]
"""Rows of sets, by role. [A] bool each"""


def without_anchors(state: ClipState, own: Chosen, inherited: Chosen, gone_from_reference: Chosen) -> ClipState:
    """A clip without some of its own anchors, that leaves out some of those it inherits.

    Args:
        own: Rows of the clip's own sets that go.
        inherited: Rows of the reference clip's sets that this clip no longer shows.
        gone_from_reference: Rows of these sets that the reference clip itself loses; none of them is shown here.
    Returns:
        With a fingerprint of its own; its reference is still that of before.
    Raises:
        ProjectError: The arrays are inconsistent.
    """
    if state.header.holds == "gaussians":
        return _stored_without(state, own)
    others = {
        name: array for name, array in state.arrays.items() if own_kind(name) is None and not is_said_of_anchors(name)
    }
    records = dict(state.anchors)
    reasons = _reasons_of_replacing(records)
    for role in {*own, *inherited, *gone_from_reference}:
        record = records.get(role, AnchorRecord())
        try:
            records[role] = _inherited_without(role, record, inherited.get(role), gone_from_reference.get(role))
            if role in own:
                records[role] = _own_without(records[role], own[role])
        except (IndexError, ValueError) as error:
            raise ProjectError(f"The {role} anchors of clip {state.header.clip_index} are inconsistent.") from error
    arrays = dict(others)
    for role, record in records.items():
        arrays |= record.arrays(role)
    if reasons is not None:
        gone = own.get("replacing")
        arrays |= AnchorRecord(reasons=reasons if gone is None else reasons[~gone]).arrays("replacing")
    smaller = ClipState(arrays, state.header).stamped()
    if smaller.header.fingerprint == state.header.fingerprint:
        return smaller
    return ClipState(arrays, replace(smaller.header, rows_of=""))  # rows are others now


def _stored_without(state: ClipState, own: Chosen) -> ClipState:
    """A clip of stored Gaussians, each of which is an anchor."""
    found = read_stored(state.arrays, state.header.n_frames)
    n_still, n_tracks = len(found.still["means"]), len(found.presence)
    still, tracks = own.get("static", np.zeros(n_still, bool)), own.get("moving", np.zeros(n_tracks, bool))
    arrays = state.arrays | found.without(still, tracks).arrays()
    return ClipState(arrays, replace(state.header, rows_of="")).stamped()


def _own_without(record: AnchorRecord, gone: np.ndarray) -> AnchorRecord:
    assert record.own is not None
    kept = StoredAnchors(**{kind: array[~gone] for kind, array in record.own.named().items()})
    reasons = record.reasons
    if reasons is not None and len(reasons) == len(gone):
        reasons = reasons[~gone]
    return AnchorRecord(kept, record.presence, record.is_hidden, record.light, reasons)


def _inherited_without(
    role: str, record: AnchorRecord, gone: np.ndarray | None, removed: np.ndarray | None
) -> AnchorRecord:
    presence, is_hidden, light, reasons = record.presence, record.is_hidden, record.light, record.reasons
    if gone is not None and gone.any():
        if presence is not None:
            presence = presence & ~gone[:, None]
        elif role == STATIC:
            is_hidden = gone if is_hidden is None else is_hidden | gone
    if removed is not None and removed.any():
        n, kept = len(removed), ~removed
        presence = presence[kept] if presence is not None else None
        is_hidden = is_hidden[kept] if is_hidden is not None else None
        light = light[kept] if light is not None else None
        reasons = reasons[kept] if reasons is not None and len(reasons) == n else reasons
    return AnchorRecord(record.own, presence, is_hidden, light, reasons)


def _reasons_of_replacing(records: Mapping[str, AnchorRecord]) -> np.ndarray | None:
    """The gate's reasons for anchors that replace static ones: as long as as many of those are hidden as there are of
    these, the reasons are those of the hidden ones. See engine.model.clip_model."""
    static, replacing = records.get(STATIC), records.get("replacing")
    if static is None or replacing is None or replacing.own is None or replacing.reasons is not None:
        return None
    if static.is_hidden is None or static.reasons is None or len(static.reasons) != len(static.is_hidden):
        return None
    reasons = static.reasons[static.is_hidden]
    return reasons if len(reasons) == len(replacing.own) else None
