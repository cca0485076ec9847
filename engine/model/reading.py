"""Clip models from stored states: a clip's own parts, and those inherited from the reference clip."""

from __future__ import annotations

import numpy as np
import torch
from msgspec.structs import asdict
from torch import Tensor

from engine.clip_files.anchor_record import AnchorRecord, StoredAnchors
from engine.clip_files.array_names import DECODER, FIELD, MOVING_DECODER
from engine.clip_files.clip_state import ClipState
from engine.clip_files.roles import ROLES, STATIC
from engine.clip_files.stored_gaussians import read_stored
from engine.errors import ProjectError
from engine.model.anchors import AnchorSet
from engine.model.clip_model import ClipModel
from engine.model.decoder import Decoder
from engine.model.field import SpatioTemporalField
from engine.model.host_array import host_array
from engine.model.model_backend import ModelBackend
from engine.model.motion import AnchorMotion
from engine.model.stored.stored_model import StoredModel


def inherit(
    reference: ClipState,
    presence: dict[str, Tensor],
    *,
    is_trainable: bool = False,
    hidden: dict[str, Tensor] | None = None,
) -> tuple[dict[str, AnchorSet], Decoder, Decoder | None]:
    """What a clip takes over from a reference clip. Copies, so that nothing learned reaches the reference.

    Args:
        reference: A finished reference clip.
        presence: Gate in time of dynamic sets in the clip that inherits; sets without one are left out. [A, M] bool
        is_trainable: Whether the anchors keep learning (an ablation; they are stored with the clip then).
        hidden: Rows that are left out, by role. [A] bool
    Returns:
        Anchor sets, heads, and those of still parts where they are others; heads are frozen.
    """
    decoder, still_decoder = _read_decoders(reference)
    sets = {}
    for role, anchors in _read_sets(reference, is_trainable=is_trainable).items():
        if anchors.presence is not None:
            if role not in presence:
                continue
            anchors.presence = presence[role]
            anchors.stay()  # they travelled with what the reference clip shows
        if hidden and role in hidden:
            anchors = anchors.subset(~hidden[role])
        sets[role] = anchors
    return sets, decoder.requires_grad_(requires_grad=False), still_decoder


def load_clip_model(
    state: ClipState, reference: ClipState | None, *, backend: ModelBackend, is_learning: bool = False
) -> ClipModel:
    """Rebuild a clip for viewing or for continuing.

    Args:
        state: The clip.
        reference: The clip it inherits from; not used for a reference clip.
        backend: The backend that decodes and draws it.
        is_learning: Keep the clip's own parameters trainable. Otherwise nothing is, and constant Gaussians
            are decoded only once.
    Raises:
        ProjectError: A source clip without its reference or with another one than it was trained on; arrays that are
            missing or do not fit together.
    """
    try:
        if state.header.holds == "gaussians":
            return StoredModel.of(state.header, read_stored(state.arrays, state.header.n_frames), backend)
        model = _rebuild(state, reference, backend)
    except (KeyError, TypeError, AttributeError, RuntimeError, ValueError) as error:  # arrays that do not fit together
        raise ProjectError(
            f"The state of clip {state.header.clip_index} is incomplete or inconsistent ({error}).",
            hint="Train this clip again.",
        ) from error
    return model if is_learning else model.requires_grad_(requires_grad=False)


def read_field(state: ClipState) -> SpatioTemporalField:
    """The field of a clip that has one. A copy."""
    assert state.header.field is not None
    field = SpatioTemporalField(state.header.field)
    field.load_state_dict(_strip(state.arrays, FIELD))
    return field


def _rebuild(state: ClipState, reference: ClipState | None, backend: ModelBackend) -> ClipModel:
    header = state.header
    hidden: dict[str, Tensor] = {}
    light: Tensor | None = None
    if state.is_reference:
        sets = _read_sets(state, is_trainable=True)
        decoder, still_decoder = _read_decoders(state)
    else:
        if reference is None:
            raise ProjectError(f"Clip {header.clip_index} inherits from a missing reference clip.")
        if reference.header.fingerprint != header.reference_fingerprint:
            raise ProjectError(
                f"Clip {header.clip_index} was trained on reference {header.reference_fingerprint}, "
                f"the project now has {reference.header.fingerprint}.",
                hint="Train this clip again.",
            )
        records = state.anchors.items()
        hidden = {role: _tensor(record.is_hidden) for role, record in records if record.is_hidden is not None}
        presence = {role: _tensor(record.presence) for role, record in records if record.presence is not None}
        inherited, decoder, still_decoder = inherit(reference, presence, hidden=hidden)
        light = _read_light(state, reference)
        sets = inherited | _read_sets(state, is_trainable=True)
        sets = {role: sets[role] for role in ROLES if role in sets}
        if _has(state, DECODER):  # all heads continued learning in this clip
            decoder, still_decoder = _read_decoders(state)
        elif _has(state, MOVING_DECODER):
            still_decoder = still_decoder or decoder
            decoder = _read_decoder(state, MOVING_DECODER)
    model = ClipModel(
        sets=sets,
        decoder=decoder,
        field=read_field(state) if header.field else None,
        clip_length=header.clip_length,
        n_frames=header.n_frames,
        backend=backend,
        light=light,
        hidden=hidden,
        still_decoder=still_decoder,
        own_heads=[prefix for prefix in (DECODER, MOVING_DECODER) if _has(state, prefix)],
    )
    if still_decoder is not None:  # they learned to the end, and are drawn by heads that no longer learn
        for anchors in sets.values():
            anchors.requires_grad_(requires_grad=anchors.is_dynamic and anchors.is_trainable)
    model.reasons = _reasons(state, reference, model)
    return model


def _read_light(state: ClipState, reference: ClipState) -> Tensor | None:
    record = state.anchors.get(STATIC)
    if record is None or record.light is None:
        return None
    inherited = reference.anchors.get(STATIC, AnchorRecord()).own
    shape = (0 if inherited is None else len(inherited), 2)
    if record.light.shape != shape or record.light.dtype != np.float32 or not (np.abs(record.light) < 3.0).all():
        raise ValueError(f"light of static anchors is {record.light.dtype} {record.light.shape}, not float32 {shape}")
    return _tensor(record.light)


def _reasons(state: ClipState, reference: ClipState | None, model: ClipModel) -> dict[str, np.ndarray]:
    """The gate's reasons for each anchor, by role; those of the reference where the clip itself was not asked."""
    reasons: dict[str, np.ndarray] = {}
    for known in (reference, state) if reference is not None and not state.is_reference else (state,):
        reasons |= {role: record.reasons for role, record in known.anchors.items() if record.reasons is not None}
    is_hidden = model.hidden.get("static")
    if is_hidden is not None and "static" in reasons:  # the clip was asked about all rows of the reference
        if "replacing" in model.roles() and len(model.anchor_set("replacing")) == int(is_hidden.sum()):
            reasons["replacing"] = reasons["static"][host_array(is_hidden)]
        reasons["static"] = reasons["static"][~host_array(is_hidden)]
    return {role: reasons[role] for role in model.roles() if len(reasons.get(role, ())) == len(model.anchor_set(role))}


def _read_sets(state: ClipState, *, is_trainable: bool) -> dict[str, AnchorSet]:
    """Anchors that a clip stores itself. Copies."""
    stored = {role: record.own for role, record in state.anchors.items() if record.own is not None}
    return {role: _read_set(anchors, is_trainable=is_trainable) for role, anchors in stored.items()}


def _read_set(stored: StoredAnchors, *, is_trainable: bool) -> AnchorSet:
    motion = (stored.birth_frames, stored.velocities, stored.accelerations)
    travels = [_tensor(array) for array in motion if array is not None]
    return AnchorSet(
        positions=_tensor(stored.positions),
        color_logits=_tensor(stored.color_logits),
        features=_tensor(stored.features),
        log_offset_scales=_tensor(stored.log_offset_scales),
        log_base_scales=_tensor(stored.log_base_scales),
        presence=None if stored.presence is None else _tensor(stored.presence),
        is_trainable=is_trainable,
        motion=AnchorMotion(*travels) if travels else None,
    )


def _read_decoders(state: ClipState) -> tuple[Decoder, Decoder | None]:
    """The heads of a clip that stores some, and the frozen ones of its still parts where they are others."""
    decoder = _read_decoder(state, DECODER)
    if not _has(state, MOVING_DECODER):
        return decoder, None
    return _read_decoder(state, MOVING_DECODER), decoder.requires_grad_(requires_grad=False)


def _has(state: ClipState, prefix: str) -> bool:
    return any(name.startswith(prefix) for name in state.arrays)


def _read_decoder(state: ClipState, prefix: str) -> Decoder:
    decoder = Decoder(**asdict(state.header.decoder))
    decoder.load_state_dict(_strip(state.arrays, prefix))
    return decoder


def _strip(arrays: dict[str, np.ndarray], prefix: str) -> dict[str, Tensor]:
    return {name.removeprefix(prefix): _tensor(array) for name, array in arrays.items() if name.startswith(prefix)}


def _tensor(array: np.ndarray) -> Tensor:
    return torch.from_numpy(array.copy())
