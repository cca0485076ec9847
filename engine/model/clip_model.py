"""ClipModel: everything that is visible in one clip. Reference and source clip are this one class.

They differ in data only: which anchor sets there are, which of them are trainable, and whether decoder and static sets
are inherited. Sets: "static", "moving" and "promoted" come from the reference clip; "residual" is added by a source
clip, "adapted" are moving ones that keep learning in a source clip and take the place of the inherited ones there.
"promoted" anchors stood still in space but changed in the reference clip, as under a lamp: they exist in all frames of
all clips. "replacing" ones are the same for one source clip: they take the place of static anchors that the clip hides.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from copy import deepcopy
from dataclasses import dataclass, fields, replace

import numpy as np
import torch
from torch import Tensor, nn

from engine.clip_files.anchor_record import AnchorRecord, StoredAnchors
from engine.clip_files.array_names import DECODER, FIELD, MOVING_DECODER
from engine.clip_files.clip_header import DecoderShape
from engine.clip_files.roles import ROLES, STATIC
from engine.gate.reasons import NO_REASON
from engine.model.anchors import AnchorSet
from engine.model.decoder import Decoder
from engine.model.decoding import ChosenAnchors, decode_anchors
from engine.model.field import SpatioTemporalField
from engine.model.grid import CornerTable
from engine.model.host_array import host_array
from engine.model.model_backend import ModelBackend
from engine.raster.gaussians import Gaussians


@dataclass(frozen=True, slots=True)
class AnchorView:
    """Anchor positions for display, scene units, numpy float32.

    Attributes:
        inherited_positions: Anchors of the reference clip in a source clip; empty in the reference clip. [A0, 3]
        own_positions: Anchors this clip trains. [A, 3]
        own_roles: Role of each own anchor, in engine.clip_files.roles.ROLES. [A] uint8
        inherited_roles: Likewise. [A0] uint8
        own_reasons: Why the gate decided so, a code of engine.gate.reasons. [A] uint8
        inherited_reasons: Likewise. [A0] uint8
        has_changing_static: Whether the static anchors have a dynamic feature, as with gate=off.
    """

    inherited_positions: np.ndarray
    own_positions: np.ndarray
    own_roles: np.ndarray
    inherited_roles: np.ndarray
    own_reasons: np.ndarray
    inherited_reasons: np.ndarray
    has_changing_static: bool = False

    def chosen(self, inherited: np.ndarray, own: np.ndarray) -> AnchorView:
        """Some of them. inherited: [A0] bool, own: [A] bool"""
        return AnchorView(
            inherited_positions=self.inherited_positions[inherited],
            own_positions=self.own_positions[own],
            own_roles=self.own_roles[own],
            inherited_roles=self.inherited_roles[inherited],
            own_reasons=self.own_reasons[own],
            inherited_reasons=self.inherited_reasons[inherited],
            has_changing_static=self.has_changing_static,
        )


class ClipModel(nn.Module):
    """Anchor sets, field and decoder of one clip. Owns no pixels, no optimiser, no files.

    Args:
        sets: Anchor sets by role.
        decoder: Heads of everything that learns.
        field: Field of this clip; None while only static anchors exist.
        clip_length: M, the divisor of clip_time.
        n_frames: Frames of this clip.
        backend: It decodes and draws the clip; anchors, decoder and field are moved to its device and dtype.
        light: Log brightness of the reference clip's static anchors at the start and the end of this clip, hidden ones
            too; None where it is as in the reference clip. [A of the reference, 2]
        hidden: Rows of the reference clip's sets that this clip leaves out; the sets given are without them already.
            By role, [A of the reference] bool
        still_decoder: Heads of still parts where they are others: those they learned with, frozen like them.
        own_heads: Heads that are the clip's own, and not a reference clip's: DECODER, MOVING_DECODER.

    Attributes:
        has_features: Whether Gaussians are decoded from features, which can be used apart.
    """

    has_features = True

    def __init__(
        self,
        *,
        sets: dict[str, AnchorSet],
        decoder: Decoder,
        field: SpatioTemporalField | None,
        clip_length: int,
        n_frames: int,
        backend: ModelBackend,
        light: Tensor | None = None,
        hidden: dict[str, Tensor] | None = None,
        still_decoder: Decoder | None = None,
        own_heads: Iterable[str] = (),
    ) -> None:
        super().__init__()
        self.backend = backend
        self.sets = nn.ModuleDict(sets)
        self.hidden = dict(hidden or {})
        self.light = light
        self.reasons: dict[str, np.ndarray] = {}  # the gate's reasons for the anchors of a role, for display
        self.decoder, self.still_decoder = decoder, still_decoder
        self.clip_length, self.n_frames = clip_length, n_frames
        self._own_heads = set(own_heads)
        self._corners: dict[str, CornerTable] = {}
        self._frozen: dict[str, Gaussians] = {}
        self._lit: dict[float, Gaussians] = {}
        self.field: SpatioTemporalField | None = None
        self.to(backend.device, backend.dtype)
        if field is not None:
            self.attach_field(field)

    def anchor_set(self, role: str) -> AnchorSet:
        """The set of a role. KeyError when there is none."""
        anchors = self.sets[role]
        assert isinstance(anchors, AnchorSet)
        return anchors

    def roles(self) -> list[str]:
        """Roles in decode order."""
        return list(self.sets.keys())

    def part(self, roles: Collection[str]) -> ClipModel:
        """A clip of some of its sets. Not for training; shares everything but caches, which are its own, so that it may
        be decoded on another thread."""
        return ClipModel(
            sets={role: self.anchor_set(role) for role in self.roles() if role in roles},
            decoder=self.decoder,
            field=self.field,
            clip_length=self.clip_length,
            n_frames=self.n_frames,
            backend=self.backend,
            light=self.light if STATIC in roles else None,
            hidden=self.hidden,
            still_decoder=self.still_decoder,
        )

    def add_set(self, role: str, anchors: AnchorSet) -> None:
        """Add anchors of a new role; a field attached later covers them."""
        self.sets[role] = anchors.to(self.backend.device, self.backend.dtype)

    def replace_sets(self, sets: dict[str, AnchorSet]) -> None:
        """Replace all anchor sets by these; a field attached later covers them."""
        self.sets = nn.ModuleDict(sets).to(self.backend.device, self.backend.dtype)
        self._corners, self._frozen, self._lit, self.hidden = {}, {}, {}, {}

    def take_out(self, role: str, is_taken: Tensor) -> AnchorSet:
        """Take rows out of a set; returns them. Those of an inherited set are hidden in this clip, and stored as such.

        Args:
            role: Of a static set.
            is_taken: [A] bool
        """
        anchors = self.anchor_set(role)
        assert not anchors.is_dynamic  # corners of a field would have to follow
        self.sets[role] = anchors.subset(~is_taken)
        self._frozen.pop(role, None)
        self._lit.clear()
        if not anchors.is_trainable:
            before = self.hidden.get(role)
            hidden = torch.zeros(len(anchors), dtype=torch.bool) if before is None else before.clone()
            hidden[~hidden] = is_taken
            self.hidden[role] = hidden
        return anchors.subset(is_taken)

    def attach_field(self, field: SpatioTemporalField) -> None:
        """Set the field and compute the interpolation constants of every dynamic set."""
        self.field = field.to(self.backend.device, self.backend.dtype)
        dynamic = (role for role in self.roles() if self.anchor_set(role).is_dynamic)
        self._corners = {role: field.corners(self.anchor_set(role).positions) for role in dynamic}

    def follow_positions(self) -> None:
        """Interpolation constants of sets whose positions learn, where they are now."""
        for role in self._corners:
            positions = self.anchor_set(role).positions
            if positions.requires_grad:
                assert self.field is not None
                self._corners[role] = self.field.corners(positions.detach())

    def freeze_still_parts(self, *, learns_heads: bool) -> None:
        """Static anchors stay as they are from here on.

        Args:
            learns_heads: Whether the heads of moving parts keep learning, apart from those of still parts; else all
                heads stay as they are, too.
        """
        if self.still_decoder is None and _learns(self.decoder):
            self._own_heads.add(DECODER)
        self.decoder.requires_grad_(requires_grad=False)
        if learns_heads:
            self.still_decoder = self.still_decoder or deepcopy(self.decoder)
            self.decoder.requires_grad_(requires_grad=True)
            self._own_heads.add(MOVING_DECODER)
        for role in self.roles():
            if not self.anchor_set(role).is_dynamic:
                self.anchor_set(role).requires_grad_(requires_grad=False)

    def unite_heads(self) -> None:
        """Heads of still parts draw all parts from here on, and are the clip's own where others drew moving ones."""
        if self.still_decoder is not None:
            self.decoder, self.still_decoder = self.still_decoder, None
            self._own_heads = {DECODER}

    def is_constant(self, role: str) -> bool:
        """Whether the set's Gaussians never change: static anchors under frozen heads."""
        anchors = self.anchor_set(role)
        is_learning = anchors.features.requires_grad or _learns(self.still_decoder or self.decoder)
        return not anchors.is_dynamic and not is_learning

    def n_constant_rows(self) -> int:
        """How many Gaussians of `decode` come first and are the same at all times, but for the light on them."""
        n = 0
        for role in self.roles():
            if not self.is_constant(role) or self.anchor_set(role).presence is not None:
                break
            n += self.decoder.gaussians_per_anchor * len(self.anchor_set(role))
        return n

    def knots(self, clip_time: float) -> list[tuple[int, float]]:
        """Frames of the clip around this time and their weights."""
        if self.field is not None:
            return self.field.knots(clip_time, self.clip_length)
        return [(min(max(round(clip_time * self.clip_length), 0), self.n_frames - 1), 1.0)]

    def alive(self, role: str, clip_time: float) -> Tensor:
        """Rows of a set that exist at this time: at a frame of its knots. [n] int64"""
        anchors = self.anchor_set(role)
        if anchors.presence is None:
            return self._all_rows(role)
        frames = [knot for knot, _ in self.knots(clip_time)]
        return anchors.presence[:, frames].any(1).nonzero()[:, 0]

    def positions(self, role: str, clip_time: float) -> Tensor:
        """Where the anchors of a set are at a time of the clip. Scene units. [A, 3]"""
        return self.anchor_set(role).positions_at(clip_time * self.clip_length)

    def _all_rows(self, role: str) -> Tensor:
        return torch.arange(len(self.anchor_set(role)), device=self.backend.device)

    def decode(self, clip_time: float, rows: dict[str, Tensor] | None = None) -> Gaussians:
        """Gaussians at a time of the clip, in [0, 1).

        Args:
            clip_time: frame_in_clip / clip_length; times between frames are interpolated.
            rows: Rows per role to decode, for instance those a camera can see; None decodes all that exist. Rows of
                dynamic sets should exist at this time, others are decoded all the same.
        Returns:
            K Gaussians per row; sets follow each other in the order of `roles`.
        """
        chosen = [
            ChosenAnchors(
                anchors=self.anchor_set(role),
                rows=self.alive(role, clip_time) if rows is None else rows[role],
                corners=self._corners.get(role),
                decoded=self.lit_gaussians(role, clip_time) if self.is_constant(role) else None,
                moved=self.positions(role, clip_time) if self.anchor_set(role).travels else None,
            )
            for role in self.roles()
        ]
        gaussians = decode_anchors(chosen, self.decoder, self.field, self.knots(clip_time), backend=self.backend)
        if self.light is None or self.is_constant(STATIC):  # constant ones are lit already
            return gaussians
        lit_rows, k = chosen[0].rows, self.decoder.gaussians_per_anchor  # static anchors come first
        n_lit, factors = k * len(lit_rows), self._light_factors(clip_time)[lit_rows].repeat_interleave(k)[:, None]
        colors = torch.cat([gaussians.colors[:n_lit] * factors, gaussians.colors[n_lit:]])
        return replace(gaussians, colors=colors)

    def constant_gaussians(self, role: str) -> Gaussians:
        """Gaussians of a whole set that `is_constant`, K per anchor, decoded at the first call."""
        if role not in self._frozen:
            self._frozen[role] = self.static_gaussians(role)
        return self._frozen[role]

    @torch.no_grad()
    def static_gaussians(self, role: str) -> Gaussians:
        """Gaussians of a whole static set as it is now, in the light of the reference clip. K per anchor"""
        everything = ChosenAnchors(anchors=self.anchor_set(role), rows=self._all_rows(role))
        heads = self.still_decoder or self.decoder
        return decode_anchors([everything], heads, None, [(0, 1.0)], backend=self.backend)

    @property
    def has_light(self) -> bool:
        """Whether light on still parts differs from the reference clip's somewhere."""
        return self.light is not None

    def light_weights(self, clip_time: float) -> tuple[float, float]:
        """Weights of the light at the start and at the end of the clip."""
        weight = min(max(clip_time * self.clip_length / self.n_frames, 0.0), 1.0)
        return 1.0 - weight, weight

    def lit_gaussians(self, role: str, clip_time: float) -> Gaussians:
        """`constant_gaussians` in the light of a time of the clip. Static anchors alone are lit; the colours are linear
        in time, so pictures of them are too."""
        gaussians = self.constant_gaussians(role)
        if role != STATIC or self.light is None:
            return gaussians
        weight = self.light_weights(clip_time)[1]
        lit = self._lit.get(weight)
        if lit is None:  # may be asked for on several threads
            if len(self._lit) > self.n_frames:  # times between frames, as playback asks for
                self._lit.clear()
            self._lit[weight] = lit = self.in_light(gaussians, clip_time)
        return lit

    def in_light(self, gaussians: Gaussians, clip_time: float) -> Gaussians:
        """Gaussians of all static anchors, K per anchor, in the light of a time of the clip."""
        factors = self._light_factors(clip_time).repeat_interleave(self.decoder.gaussians_per_anchor)
        return replace(gaussians, colors=gaussians.colors * factors[:, None])

    def _light_factors(self, clip_time: float) -> Tensor:
        """The brightness factors of the static anchors. [A]"""
        assert self.light is not None
        is_hidden, features = self.hidden.get(STATIC), self.anchor_set(STATIC).features
        light = (self.light if is_hidden is None else self.light[~is_hidden]).to(features.device, features.dtype)
        return torch.exp(light) @ features.new_tensor(self.light_weights(clip_time))

    def anchors(self, clip_time: float | None = None) -> AnchorView:
        """Positions for display: all, or those that exist at a time of the clip, in [0, 1)."""
        nothing = (np.zeros((0, 3), np.float32), np.zeros(0, np.uint8), np.zeros(0, np.uint8))
        inherited, own = [nothing], [nothing]
        for role in self.roles():
            anchors = self.anchor_set(role)
            rows = np.arange(len(anchors)) if clip_time is None else host_array(self.alive(role, clip_time))
            reasons = self.reasons.get(role)
            places = anchors.positions if clip_time is None else self.positions(role, clip_time)
            shown = (
                host_array(places)[rows],
                np.full(len(rows), ROLES.index(role), np.uint8),
                np.full(len(rows), NO_REASON, np.uint8) if reasons is None else reasons[rows],
            )
            (own if anchors.is_trainable else inherited).append(shown)
        inherited_points, inherited_roles, inherited_reasons = map(np.concatenate, zip(*inherited, strict=True))
        own_points, own_roles, own_reasons = map(np.concatenate, zip(*own, strict=True))
        return AnchorView(
            inherited_positions=inherited_points,
            own_positions=own_points,
            own_roles=own_roles,
            inherited_roles=inherited_roles,
            own_reasons=own_reasons,
            inherited_reasons=inherited_reasons,
            has_changing_static=STATIC in self.roles() and self.anchor_set(STATIC).is_dynamic,
        )

    def entries_in_use(self) -> list[np.ndarray]:
        """Entries of each of the field's tables that some anchor reads in a frame it exists in. [L, T] bool each"""
        if self.field is None:
            return []
        shape = self.field.shape
        levels = np.arange(len(shape.cells))[None, :, None]
        used = [np.zeros((len(shape.cells), shape.n_entries), bool) for _ in self.field.tables]
        for role, corners in self._corners.items():
            presence = self.anchor_set(role).presence
            assert presence is not None  # only dynamic sets have corners
            for knot, is_alive in enumerate(host_array(presence).T):
                indices = (
                    host_array(corners.indices)[is_alive] ^ host_array(self.field.keys[knot])[:, None]
                )  # [n, L, 8]
                used[0 if shape.is_shared else knot][levels, indices] = True
        return used

    def own_arrays(self) -> dict[str, np.ndarray]:
        """Everything this clip must store; inherited sets leave only their presence in this clip. Copies."""
        arrays: dict[str, np.ndarray] = {}
        for role in self.roles():
            anchors, is_hidden = self.anchor_set(role), self.hidden.get(role)
            presence = None if anchors.presence is None or anchors.is_trainable else _copy(anchors.presence)
            record = AnchorRecord(
                own=_stored(anchors) if anchors.is_trainable else None,
                presence=presence,
                is_hidden=None if is_hidden is None else _copy(is_hidden),
                light=_copy(self.light) if role == STATIC and self.light is not None else None,
            )
            arrays |= record.arrays(role)
        still_heads = self.still_decoder or self.decoder
        if DECODER in self._own_heads or _learns(still_heads):
            arrays |= {f"{DECODER}{name}": _copy(value) for name, value in still_heads.state_dict().items()}
        if MOVING_DECODER in self._own_heads:
            arrays |= {f"{MOVING_DECODER}{name}": _copy(value) for name, value in self.decoder.state_dict().items()}
        if self.field is not None:
            arrays |= {f"{FIELD}{name}": _copy(value) for name, value in self.field.state_dict().items()}
        return arrays


def _learns(module: nn.Module) -> bool:
    return any(parameter.requires_grad for parameter in module.parameters())


def _copy(tensor: Tensor) -> np.ndarray:
    return host_array(tensor).copy()


def _stored(anchors: AnchorSet) -> StoredAnchors:
    tensors = {attribute.name: getattr(anchors, attribute.name, None) for attribute in fields(StoredAnchors)}
    return StoredAnchors(**{kind: _copy(tensor) for kind, tensor in tensors.items() if tensor is not None})


def decoder_shape(decoder: Decoder) -> DecoderShape:
    """Constructor arguments of a decoder, for a header."""
    return DecoderShape(decoder.static_dim, decoder.dynamic_dim, decoder.gaussians_per_anchor, decoder.hidden)
