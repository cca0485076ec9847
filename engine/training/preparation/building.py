"""From clouds to the parts of a ClipModel: anchor sets, decoder, and inherited parts of a source clip.

Sizes follow the data and the reasons are returned as lines to report. Nothing here trains or looks at pixels.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from scipy.spatial import KDTree

from engine.capture.clip import Clip
from engine.clip_files.clip_header import Coverage
from engine.clip_files.clip_state import ClipState
from engine.cloud.motion.budget import NOBODY, choose_within_budget
from engine.cloud.motion.dedup import mean_neighbor_distance, neighbor_distances, residual_rows
from engine.cloud.motion.moving_cloud import MovingCloud
from engine.cloud.stereo.static_cloud import StaticCloud
from engine.model.anchors import AnchorSet
from engine.model.clip_model import ClipModel
from engine.model.decoder import Decoder
from engine.model.host_array import host_array
from engine.model.model_backend import ModelBackend
from engine.model.motion import AnchorMotion
from engine.model.reading import inherit
from engine.training.config import TrainConfig

_REACH_SPACINGS = 1.05
"""How far an anchor stands in for points that did not become anchors: the voxels that share a face with its own."""

_MIN_SQUARE = 1e-7
"""Least distance to neighbours, scene units squared, as released: for points that coincide."""


def static_model(
    cloud: StaticCloud, clip: Clip, config: TrainConfig, backend: ModelBackend, generator: torch.Generator
) -> ClipModel:
    """A reference clip before its motion is known: static anchors and a fresh decoder."""
    decoder = Decoder(
        static_dim=config.static_feature_dim,
        dynamic_dim=config.dynamic_feature_dim,
        gaussians_per_anchor=config.gaussians_per_anchor,
        hidden=config.head_hidden,
        generator=generator,
        is_plain=config.initial == "published",
    )
    sets = {"static": static_anchors(cloud, config)}
    return _without_field(sets, decoder, clip, backend)


def _without_field(
    sets: dict[str, AnchorSet],
    decoder: Decoder,
    clip: Clip,
    backend: ModelBackend,
    still_decoder: Decoder | None = None,
) -> ClipModel:
    return ClipModel(
        sets=sets,
        decoder=decoder,
        field=None,
        clip_length=clip.clip_length,
        n_frames=clip.n_frames,
        backend=backend,
        still_decoder=still_decoder,
    )


def static_anchors(cloud: StaticCloud, config: TrainConfig) -> AnchorSet:
    """Fresh trainable anchors on a static cloud."""
    return _fresh(cloud.points, cloud.colors, cloud.sizes, None, config)


def _fresh(
    points: np.ndarray,
    colors: np.ndarray,
    sizes: np.ndarray | float,
    presence: np.ndarray | None,
    config: TrainConfig,
    others: np.ndarray | None = None,
    motion: AnchorMotion | None = None,
) -> AnchorSet:
    """Anchors with the start that the settings say.

    Args:
        others: Anchors that are there already, neighbours as well. [S, 3]
    """
    places, present = torch.from_numpy(points), None if presence is None else torch.from_numpy(presence)
    if config.initial == "published":
        among = points if others is None else np.concatenate([points, others.astype(points.dtype)])
        squares = (neighbor_distances(among, k=3)[: len(points)] ** 2).mean(1)
        distances = torch.from_numpy(np.sqrt(np.maximum(squares, _MIN_SQUARE)))
        return AnchorSet.from_points(
            places, distances=distances, feature_dim=config.static_feature_dim, presence=present
        )
    return AnchorSet.from_cloud(
        places,
        torch.from_numpy(colors),
        spacing=torch.as_tensor(sizes),
        feature_dim=config.static_feature_dim,
        presence=present,
        motion=motion,
    )


def inheriting_model(reference: ClipState, clip: Clip, backend: ModelBackend, *, learns: bool) -> ClipModel:
    """A source clip before its motion is known: all that the reference has, and no moving anchor alive yet.

    Args:
        learns: Whether the anchors keep learning. The decoder is frozen.
    """
    presence = {
        # promoted anchors are part of the still scene and exist at all times; moving parts are not known yet
        role: torch.full((len(record.own), clip.n_frames), role == "promoted")
        for role, record in reference.anchors.items()
        if record.own is not None and record.own.presence is not None
    }
    sets, decoder, still_decoder = inherit(reference, presence, is_trainable=learns)
    return _without_field(sets, decoder, clip, backend, still_decoder)


def moving_anchors(
    cloud: MovingCloud, rows: np.ndarray, config: TrainConfig, others: np.ndarray | None = None
) -> AnchorSet:
    """Fresh trainable anchors on the chosen rows of a moving cloud.

    Args:
        rows: [P] bool
        others: Anchors that are there already. [S, 3]
    """
    chosen = cloud.chosen(rows)
    motion = _motion_of(chosen)
    return _fresh(chosen.points, chosen.colors, float(cloud.spacing), chosen.presence, config, others, motion)


def _motion_of(cloud: MovingCloud) -> AnchorMotion | None:
    return None if cloud.motion is None else AnchorMotion(*map(torch.from_numpy, cloud.motion))


@dataclass(frozen=True, slots=True)
class ResidualAnchors:
    """The moving points of a source clip that become its own anchors.

    Attributes:
        rows: Points that do. [P] bool
        presence: Of all points; that of a chosen one includes the points that it stands in for. [P, M] bool
        is_reached: Points within reach of an anchor, own or inherited. [P] bool
        n_left_out: Points that would have become anchors beyond the budget.
        reason: Why these, one clause.
    """

    rows: np.ndarray
    presence: np.ndarray
    is_reached: np.ndarray
    n_left_out: int
    reason: str


def uncovered_points(cloud: MovingCloud, is_new: np.ndarray, n_used: int, config: TrainConfig) -> ResidualAnchors:
    """Points that no inherited anchor covers, as far as `config.max_moving_points` lets them become anchors.

    A clip has no more anchors that move than that, inherited ones that it uses included. Which of the others become
    anchors then is chosen by `engine.cloud.motion.budget`; the rest switch on the one next to them.

    Args:
        cloud: The clip's moving points.
        is_new: Points that no inherited anchor covers. [P] bool
        n_used: Inherited anchors that exist in some frame of the clip.
        config: Gives the most anchors.
    """
    budget, limit = _residual_budget(cloud.presence[is_new], n_used, config)
    if is_new.sum() <= budget:
        return ResidualAnchors(is_new, cloud.presence, np.ones_like(is_new), 0, "all of them")
    rows, presence, is_reached = _within_budget(cloud, is_new, budget)
    return ResidualAnchors(rows, presence, is_reached, int((is_new & ~rows).sum()), limit)


def add_residual(
    model: ClipModel,
    cloud: MovingCloud,
    config: TrainConfig,
    choose: Callable[[MovingCloud, np.ndarray, int, TrainConfig], ResidualAnchors] = uncovered_points,
    covering: Sequence[str] = ("moving",),
) -> Coverage:
    """Split a source clip's points into those the reference covers and residual anchors; says how many.

    A point is covered when it lies inside the union of spheres around the inherited anchors that can change, each with
    the mean distance to its three nearest neighbours as radius. Covered points switch on the inherited anchor nearest
    to them in the frames they are present in, so nothing covered is left without an anchor; the others become residual
    anchors. Where points travel all of them do: an inherited anchor was on something else. Source: ClipGStream,
    geometry-aware deduplication, with the exact union.

    Args:
        choose: Chooses residual anchors, see engine.training.preparation.method.Method.choose_residual.
        covering: Roles of the inherited anchors that have spheres, see Method.covering.
    """
    is_new = np.ones(len(cloud.points), bool)
    inherited = [model.anchor_set(role) for role in covering if role in model.roles()]
    n_used, travels = 0, cloud.motion is not None
    if inherited and len(cloud.points):
        centers = np.concatenate([host_array(anchors.positions) for anchors in inherited])
        is_new = residual_rows(cloud.points, centers, mean_neighbor_distance(centers, k=3))
        if not travels:
            nearest = np.atleast_1d(KDTree(centers).query(cloud.points[~is_new])[1])
            n_used = _switch_on(model, inherited, nearest, cloud.presence[~is_new])
    chosen = choose(cloud, is_new | travels, n_used, config)
    if chosen.rows.any():
        others = [host_array(model.anchor_set(role).positions) for role in model.roles()]
        residual = moving_anchors(
            replace(cloud, presence=chosen.presence), chosen.rows, config, np.concatenate(others) if others else None
        )
        if inherited and config.initial == "cloud" and not travels:
            _start_like_neighbors(residual, inherited)
        model.add_set("residual", residual)
    return Coverage(
        n_points=len(is_new),
        n_inherited=int((~is_new).sum()),
        n_residual=int(chosen.rows.sum()),
        n_left_out=chosen.n_left_out,
        share=float(chosen.is_reached.mean()) if len(is_new) else 1.0,
        reason=chosen.reason,
    )


def _switch_on(model: ClipModel, inherited: Sequence[AnchorSet], nearest: np.ndarray, presence: np.ndarray) -> int:
    """Inherited anchors exist where the points next to them do; returns how many.

    Args:
        nearest: The anchor nearest to each point, counted over all the sets. [n]
        presence: Of the points. [n, M] bool
    """
    everywhere = np.zeros((sum(map(len, inherited)), presence.shape[1]), bool)
    np.logical_or.at(everywhere, nearest, presence)
    parts = np.split(everywhere, np.cumsum([len(anchors) for anchors in inherited])[:-1])
    for anchors, part in zip(inherited, parts, strict=True):
        anchors.presence = torch.from_numpy(part).to(model.backend.device)
    return int(everywhere.any(1).sum())


def adapt_moving(model: ClipModel, *, all_of_them: bool = False) -> None:
    """Inherited moving anchors that exist in this clip become its own, as they are, and keep learning; others go.

    Args:
        all_of_them: Also those that exist in none of its frames.
    """
    if "moving" not in model.roles():
        return
    moving = model.anchor_set("moving")
    assert moving.presence is not None
    is_used = torch.ones(len(moving), dtype=torch.bool) if all_of_them else moving.presence.any(1)
    model.replace_sets({role: model.anchor_set(role) for role in model.roles() if role != "moving"})
    if is_used.any():
        model.add_set("adapted", moving.subset(is_used, is_trainable=True))


def adapt_heads(model: ClipModel) -> None:
    """Heads of what moves keep learning in a source clip in which something moves."""
    presences = [model.anchor_set(role).presence for role in model.roles()]
    if any(presence is not None and bool(presence.any()) for presence in presences):
        model.freeze_still_parts(learns_heads=True)


def _residual_budget(presence: np.ndarray, n_used: int, config: TrainConfig) -> tuple[int, str]:
    """Most residual anchors of a clip, and why.

    Args:
        presence: Of the points that would become anchors. [P, M] bool
        n_used: Inherited anchors that exist in some frame of the clip.
    """
    rest, n_alive = config.max_moving_points - n_used, int(presence.sum(0).max(initial=0))
    if rest >= n_alive:
        return rest, f"at most {config.max_moving_points} a clip, {n_used} inherited ones in use"
    return n_alive, "as many as in the busiest frame"


def _within_budget(cloud: MovingCloud, is_new: np.ndarray, budget: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows that become anchors [P], presence with that of the points next to them [P, M], points within reach [P]."""
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


def _start_like_neighbors(residual: AnchorSet, inherited: Sequence[AnchorSet]) -> None:
    """Residual anchors begin with the look of the nearest of the inherited ones: frozen heads know it."""
    centers = np.concatenate([host_array(anchors.positions) for anchors in inherited])
    _, nearest = KDTree(centers).query(host_array(residual.positions))
    rows = torch.from_numpy(nearest)
    with torch.no_grad():
        for name in ("features", "log_offset_scales", "log_base_scales"):
            values = torch.cat([getattr(anchors, name) for anchors in inherited])
            getattr(residual, name).copy_(values[rows])
