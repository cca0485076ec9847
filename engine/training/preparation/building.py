"""From clouds to the parts of a ClipModel: anchor sets, decoder, and what a source clip inherits.

Sizes follow the data and the reasons are returned as lines to report. Nothing here trains or looks at pixels.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
from msgspec.structs import asdict
from scipy.spatial import KDTree

from engine.capture.clip import Clip
from engine.clip_files.anchor_record import AnchorRecord
from engine.clip_files.clip_header import Coverage
from engine.clip_files.clip_state import ClipState
from engine.cloud.motion.budget import NOBODY, choose_within_budget
from engine.cloud.motion.dedup import mean_neighbor_distance, residual_rows
from engine.cloud.motion.moving_cloud import MovingCloud
from engine.cloud.stereo.static_cloud import StaticCloud
from engine.model.anchors import AnchorSet
from engine.model.clip_model import ClipModel, decoder_shape, inherit
from engine.model.decoder import Decoder
from engine.training.config import TrainConfig

_REACH_SPACINGS = 1.05
"""How far an anchor stands in for points that did not become anchors: the voxels that share a face with its own."""


def static_model(cloud: StaticCloud, clip: Clip, config: TrainConfig, generator: torch.Generator) -> ClipModel:
    """A reference clip before its motion is known: static anchors and a fresh decoder."""
    decoder = Decoder(
        static_dim=config.static_feature_dim,
        dynamic_dim=config.dynamic_feature_dim,
        gaussians_per_anchor=config.gaussians_per_anchor,
        hidden=config.head_hidden,
        generator=generator,
    )
    sets = {"static": static_anchors(cloud, config)}
    return ClipModel(sets=sets, decoder=decoder, field=None, clip_length=clip.clip_length, n_frames=clip.n_frames)


def static_anchors(cloud: StaticCloud, config: TrainConfig) -> AnchorSet:
    """Fresh trainable anchors on a static cloud."""
    return AnchorSet.from_cloud(
        torch.from_numpy(cloud.points),
        torch.from_numpy(cloud.colors),
        spacing=float(cloud.spacing),
        feature_dim=config.static_feature_dim,
        presence=None,
    )


def inheriting_model(reference: ClipState, clip: Clip, config: TrainConfig) -> tuple[ClipModel, str]:
    """A source clip before its motion is known: what it inherits, and no moving anchor alive yet; says what learns.

    `config.inherit` says whether anchors may learn. The decoder is the reference's and with inherit=off the anchors
    are there all the same, because the clip's backgrounds are corrected with a render of both; `choose_decoder` and
    `drop_inherited` come after that.
    """
    presence = {
        # promoted anchors are part of the still scene and exist at all times; what moves is not known yet
        role: torch.full((len(record.own), clip.n_frames), role == "promoted")
        for role, record in reference.anchors.items()
        if record.own is not None and record.own.presence is not None
    }
    sets, decoder = inherit(reference, presence, is_trainable=config.inherit == "trainable")
    model = ClipModel(sets=sets, decoder=decoder, field=None, clip_length=clip.clip_length, n_frames=clip.n_frames)
    words = {
        "frozen": "kept as they are",
        "moving": "kept as they are if static, learning on if moving",
        "trainable": "learning on",
        "off": "left out",
    }
    heads = {"frozen": "kept as it is", "finetune": "learning on", "new": "new"}
    return model, f"inherited anchors {words[config.inherit]}, decoder {heads[config.decoder]}"


def choose_decoder(model: ClipModel, config: TrainConfig, *, seed: int) -> None:
    """`config.decoder`: the inherited heads as they are, the same heads learning on, or new ones.

    Args:
        seed: Of new heads, which have a generator of their own: what else starts at random is the same for any choice.
    """
    if config.decoder == "new":
        model.decoder = Decoder(**asdict(decoder_shape(model.decoder)), generator=torch.Generator().manual_seed(seed))
    model.decoder.requires_grad_(config.decoder != "frozen")


def merged(state: ClipState) -> ClipState:
    """A finished clip as a start for another: its residual anchors count among the moving ones from here on, its
    replacing ones among the promoted."""
    own = {role: record.own for role, record in state.anchors.items() if record.own is not None}
    arrays = dict(state.arrays)
    for added, among in (("residual", "moving"), ("replacing", "promoted")):
        if added not in own:
            continue
        for name in AnchorRecord(own=own[added]).arrays(added):
            del arrays[name]
        anchors = own[among].joined(own[added]) if among in own else own[added]
        arrays |= AnchorRecord(own=anchors).arrays(among)
    return ClipState(arrays, state.header)


def drop_inherited(model: ClipModel, cloud: StaticCloud, config: TrainConfig) -> None:
    """inherit=off: static anchors of the clip's own take the place of all inherited ones."""
    model.replace_sets({"static": static_anchors(cloud, config)})


def moving_anchors(cloud: MovingCloud, rows: np.ndarray, config: TrainConfig) -> AnchorSet:
    """Fresh trainable anchors on the chosen rows of a moving cloud. rows: [P] bool"""
    return AnchorSet.from_cloud(
        torch.from_numpy(cloud.points[rows]),
        torch.from_numpy(cloud.colors[rows]),
        spacing=float(cloud.spacing),
        feature_dim=config.static_feature_dim,
        presence=torch.from_numpy(cloud.presence[rows]),
    )


def add_residual(model: ClipModel, cloud: MovingCloud, config: TrainConfig) -> Coverage:
    """Split a source clip's moving points into those the reference covers and residual anchors; says how many.

    A point is covered when it lies inside the union of spheres around the inherited moving anchors, each with the
    mean distance to its three nearest neighbours as radius. Covered points switch on the inherited anchor nearest to
    them in the frames they are present in, so nothing covered is left without an anchor; the others become residual
    anchors. Source: ClipGStream, geometry-aware deduplication, with the exact union.

    A clip has no more anchors that move than `config.max_moving_points`, inherited ones that it uses included. Which
    of the others become anchors then is chosen by `engine.cloud.motion.budget`; the rest switch on the one beside them.
    """
    is_new = np.ones(len(cloud.points), bool)
    moving = model.anchor_set("moving") if "moving" in model.roles() else None
    n_used = 0
    if moving is not None and len(cloud.points):
        centers = moving.positions.numpy()
        is_new = residual_rows(cloud.points, centers, mean_neighbor_distance(centers, k=3))
        _, nearest = KDTree(centers).query(cloud.points[~is_new])
        presence = np.zeros((len(centers), cloud.presence.shape[1]), bool)
        np.logical_or.at(presence, nearest, cloud.presence[~is_new])
        moving.presence = torch.from_numpy(presence)
        n_used = int(presence.any(1).sum())
    chosen, presence, is_reached, reason = is_new, cloud.presence, np.ones(len(cloud.points), bool), "all of them"
    if config.residual == "none":
        chosen, is_reached, reason = np.zeros_like(is_new), ~is_new, "residual=none"
    elif config.residual == "full":
        chosen, reason = is_reached, "all moving points, residual=full"
    else:
        budget, limit = _residual_budget(cloud.presence[is_new], n_used, config)
        if is_new.sum() > budget:
            chosen, presence, is_reached = _within_budget(cloud, is_new, budget)
            reason = limit
    if chosen.any():
        residual = moving_anchors(replace(cloud, presence=presence), chosen, config)
        if moving is not None:
            _start_like_neighbors(residual, moving)
        model.add_set("residual", residual)
    if moving is not None and config.inherit == "moving":
        _adapt(model, moving, config)
    return Coverage(
        n_points=len(is_new),
        n_inherited=int((~is_new).sum()),
        n_residual=int(chosen.sum()),
        n_left_out=int((is_new & ~chosen).sum()) if config.residual == "dedup" else 0,
        share=float(is_reached.mean()) if len(is_reached) else 1.0,
        reason=reason,
    )


def _adapt(model: ClipModel, moving: AnchorSet, config: TrainConfig) -> None:
    """inherit=moving: inherited moving anchors that exist in this clip become its own, as they are; others go."""
    assert moving.presence is not None
    has_gate_in_time = config.gate not in ("off", "static")
    is_used = moving.presence.any(1) if has_gate_in_time else torch.ones(len(moving), dtype=torch.bool)
    model.replace_sets({role: model.anchor_set(role) for role in model.roles() if role != "moving"})
    if is_used.any():
        model.add_set("adapted", moving.subset(is_used, is_trainable=True))


def _residual_budget(presence: np.ndarray, n_used: int, config: TrainConfig) -> tuple[int, str]:
    """Most residual anchors of a clip, and why.

    Args:
        presence: Of the points that would become anchors. [P, M] bool
        n_used: Inherited anchors that exist in some frame of the clip.
    """
    rest, n_alive = config.max_moving_points - n_used, int(presence.sum(0).max(initial=0))
    if rest >= n_alive:
        return rest, f"at most {config.max_moving_points} a clip, {n_used} inherited ones in use"
    return n_alive, "as many as are there in the busiest frame"


def _within_budget(cloud: MovingCloud, is_new: np.ndarray, budget: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows that become anchors [P], presence with that of the points beside them [P, M], points within reach [P]."""
    rows = np.flatnonzero(is_new)
    is_chosen, stand_in = choose_within_budget(
        cloud.points[rows], cloud.presence[rows], budget=budget, reach=_REACH_SPACINGS * cloud.spacing
    )
    has_other = (stand_in != NOBODY) & ~is_chosen
    presence, is_reached = cloud.presence.copy(), ~is_new
    np.logical_or.at(presence, rows[stand_in[has_other]], cloud.presence[rows[has_other]])
    is_reached[rows] = stand_in != NOBODY
    chosen = np.zeros_like(is_new)
    chosen[rows[is_chosen]] = True
    return chosen, presence, is_reached


def _start_like_neighbors(residual: AnchorSet, moving: AnchorSet) -> None:
    """Residual anchors begin with the look of the nearest inherited moving anchor: frozen heads know it."""
    _, nearest = KDTree(moving.positions.numpy()).query(residual.positions.numpy())
    rows = torch.from_numpy(nearest)
    with torch.no_grad():
        residual.features.copy_(moving.features[rows])
        residual.log_offset_scales.copy_(moving.log_offset_scales[rows])
        residual.log_base_scales.copy_(moving.log_base_scales[rows])


def remove_gate(model: ClipModel, *, in_time_only: bool = False) -> None:
    """gate=off, the published method: every anchor has a dynamic feature at every time.

    Args:
        in_time_only: gate=static: static anchors stay without one; dynamic anchors exist at every time.
    """
    for role in model.roles():
        anchors = model.anchor_set(role)
        if anchors.is_dynamic or not in_time_only:
            anchors.presence = torch.ones(len(anchors), model.n_frames, dtype=torch.bool)
