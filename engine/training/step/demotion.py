"""What a trained clip does not need: anchors that nobody ever sees, and dynamic ones that learned no change.

An anchor whose Gaussians stay too transparent to be drawn, at every frame and halfway between frames, goes. A promoted
or moving anchor that exists in every frame and looks, all the time, as it would without a dynamic feature becomes
static, decoded once. A replacing anchor that looks as the static one it replaced goes, and that one comes back. The
first is exact; the other two are undone where any pixel of the training cameras would change by more than MAX_CHANGE.

Works on states, so that a demoted clip is read like any other.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

from engine.clip_files.clip_state import ClipState
from engine.gate.reasons import LEARNED_NOTHING
from engine.model.clip_model import ClipModel, inherit, load_clip_model
from engine.model.clip_view import View, render_model
from engine.model.decode.decoding import ChosenAnchors, decode_anchors
from engine.raster.gaussians import Gaussians

MIN_OPACITY = 1.0 / 255.0
"""Below it the rasterizer draws nothing (engine.raster)."""
MAX_CHANGE = 1.0 / 255.0
"""Of any channel of any pixel that is looked at: one grey level."""
N_CAMERAS = 8
_VALUE_TOLERANCE = 0.5 / 255.0  # of colours and opacities
_SIZE_TOLERANCE = 0.01  # of means, in the smallest scale, and of scales
_ANGLE_TOLERANCE = 1e-5  # 1 - |cosine| of half the angle: half a degree


def demote(
    state: ClipState, reference: ClipState | None, views: Sequence[View], *, reach: float
) -> tuple[ClipState, str]:
    """Leave out what a trained clip does not need; says what.

    Args:
        state: As trained; its arrays stay as they are.
        reference: What it inherits from; None for a clip that inherits nothing.
        views: Training cameras, of which at most N_CAMERAS are looked through.
        reach: Of the anchors' Gaussians, scene units, for culling.
    """
    model = load_clip_model(state, reference)
    times = [half / (2 * model.clip_length) for half in range(2 * model.n_frames - 1)]
    with torch.no_grad():
        arrays, n_dropped, n_cleared = _without_unseen(dict(state.arrays), model, times)
        seen = ClipState(arrays, state.header)
        model = load_clip_model(seen, reference)
        arrays, n_still = _without_unchanging(dict(arrays), model, reference, times)
    said = f"{n_dropped} own anchors are never visible and go, {n_cleared} inherited ones rest in this clip"
    if not n_still:
        return seen, f"{said}; 0 learned no change"
    still = ClipState(arrays, state.header)
    change = _largest_change(model, load_clip_model(still, reference), views, reach=reach)
    if not change <= MAX_CHANGE:
        return seen, f"{said}; {n_still} learned little, but pixels would change by {255 * change:.2g} levels"
    return still, f"{said}; {n_still} learned no change and are static, pixels change by {255 * change:.2g} levels"


def _without_unseen(
    arrays: dict[str, np.ndarray], model: ClipModel, times: Sequence[float]
) -> tuple[dict[str, np.ndarray], int, int]:
    """Arrays without anchors that are never visible; how many own ones went, how many inherited ones rest."""
    n_dropped = n_cleared = 0
    k = model.decoder.gaussians_per_anchor  # given, not found out: there may not be a row at a time
    for role in model.roles():
        anchors = model.anchor_set(role)
        if anchors.presence is None or len(anchors) == 0:
            continue
        is_visible = torch.zeros(len(anchors), dtype=torch.bool)
        for clip_time in times:
            rows = model.alive(role, clip_time)
            opacities = _decode(model, role, clip_time, rows).opacities
            # not a number counts as visible: it is for the writer of the clip to refuse
            is_visible[rows] |= (~(opacities < MIN_OPACITY)).reshape(len(rows), k).any(dim=1)
        if anchors.is_trainable:
            n_dropped += int((~is_visible).sum())
            _keep_rows(arrays, role, is_visible.numpy())
        else:
            was_alive = anchors.presence.any(dim=1)
            n_cleared += int((was_alive & ~is_visible).sum())
            arrays[f"inherited.{role}.presence"] = (anchors.presence & is_visible[:, None]).numpy()
    return arrays, n_dropped, n_cleared


def _without_unchanging(
    arrays: dict[str, np.ndarray], model: ClipModel, reference: ClipState | None, times: Sequence[float]
) -> tuple[dict[str, np.ndarray], int]:
    """Arrays with unchanging anchors among the static ones, and how many these are."""
    if reference is None:
        roles = [role for role in ("moving", "promoted") if role in model.roles()]
        return arrays, sum(_become_static(arrays, model, role, times) for role in roles)
    is_hidden = arrays.get("inherited.static.is_hidden")
    if is_hidden is None or "replacing" not in model.roles():
        return arrays, 0
    rows = np.flatnonzero(is_hidden)
    own = model.anchor_set("replacing")
    # replacing anchors that were never visible are gone by now: positions say which one replaced which
    inherited = reference.arrays["sets.static.positions"][rows]
    index = {position.tobytes(): row for position, row in zip(inherited, rows, strict=True)}
    replaced = np.array([index[position.tobytes()] for position in own.positions.numpy()], dtype=np.int64)
    static_set = inherit(reference, {})[0]["static"]
    chosen = ChosenAnchors(anchors=static_set, rows=torch.from_numpy(replaced))
    static = decode_anchors([chosen], model.decoder, None, [(0, 1.0)])
    is_still = _looks_like(model, "replacing", times, static)
    if is_still.any():
        arrays["inherited.static.is_hidden"] = is_hidden.copy()
        arrays["inherited.static.is_hidden"][replaced[is_still]] = False
        _note(arrays, replaced[is_still])
        if not arrays["inherited.static.is_hidden"].any():
            del arrays["inherited.static.is_hidden"]
        _keep_rows(arrays, "replacing", ~is_still)
    return arrays, int(is_still.sum())


def _become_static(arrays: dict[str, np.ndarray], model: ClipModel, role: str, times: Sequence[float]) -> int:
    anchors = model.anchor_set(role)
    static = model.anchor_set("static") if "static" in model.roles() else None
    if static is None or static.is_dynamic or anchors.presence is None:
        return 0
    everything = ChosenAnchors(anchors=anchors, rows=torch.arange(len(anchors)))
    without = decode_anchors([everything], model.decoder, None, [(0, 1.0)])
    is_still = _looks_like(model, role, times, without) & anchors.presence.all(dim=1).numpy()
    if is_still.any():
        n_static = len(arrays["sets.static.positions"])
        for name in [name for name in arrays if name.startswith("sets.static.")]:
            own = arrays[f"sets.{role}.{name.removeprefix('sets.static.')}"]
            arrays[name] = np.concatenate([arrays[name], own[is_still]])
        if "gate.static" in arrays:
            arrays["gate.static"] = np.concatenate([arrays["gate.static"], np.zeros(int(is_still.sum()), np.uint8)])
        _note(arrays, np.arange(n_static, n_static + int(is_still.sum())))
        _keep_rows(arrays, role, ~is_still)
    return int(is_still.sum())


def _note(arrays: dict[str, np.ndarray], rows: np.ndarray) -> None:
    if "gate.static" in arrays:
        arrays["gate.static"] = arrays["gate.static"].copy()
        arrays["gate.static"][rows] = LEARNED_NOTHING


def _keep_rows(arrays: dict[str, np.ndarray], role: str, is_kept: np.ndarray) -> None:
    """In place; a set without rows goes altogether."""
    for name in [name for name in arrays if name.startswith(f"sets.{role}.") or name == f"gate.{role}"]:
        if is_kept.any():
            arrays[name] = arrays[name][is_kept]
        else:
            del arrays[name]


def _decode(model: ClipModel, role: str, clip_time: float, rows: torch.Tensor) -> Gaussians:
    nothing = torch.zeros(0, dtype=torch.int64)
    return model.decode(clip_time, dict.fromkeys(model.roles(), nothing) | {role: rows})


def _looks_like(model: ClipModel, role: str, times: Sequence[float], static: Gaussians) -> np.ndarray:
    """Anchors whose Gaussians are those given at all times. static: of all rows; gives [A] bool"""
    n_anchors = len(model.anchor_set(role))
    is_alike = torch.ones(len(static), dtype=torch.bool)
    for clip_time in times:
        is_alike &= _alike(_decode(model, role, clip_time, torch.arange(n_anchors)), static)
    return is_alike.reshape(n_anchors, -1).all(dim=1).numpy()


def _alike(first: Gaussians, second: Gaussians) -> torch.Tensor:
    smallest = second.scales.amin(dim=1, keepdim=True)
    cosines = torch.nn.functional.cosine_similarity(first.quats, second.quats, dim=1).abs()
    return (
        ((first.means - second.means).abs() <= _SIZE_TOLERANCE * smallest).all(dim=1)
        & ((first.scales - second.scales).abs() <= _SIZE_TOLERANCE * second.scales).all(dim=1)
        & (1.0 - cosines <= _ANGLE_TOLERANCE)
        & ((first.opacities - second.opacities).abs() <= _VALUE_TOLERANCE)
        & ((first.colors - second.colors).abs() <= _VALUE_TOLERANCE).all(dim=1)
    ) | ((first.opacities < MIN_OPACITY) & (second.opacities < MIN_OPACITY))


def _largest_change(before: ClipModel, after: ClipModel, views: Sequence[View], *, reach: float) -> float:
    """Largest difference of a channel between the pictures of two models: first, middle and last frame."""
    largest = 0.0
    frames = sorted({0, before.n_frames // 2, before.n_frames - 1})
    for view in views[:: max(1, -(-len(views) // N_CAMERAS))]:
        for frame in frames:
            clip_time = frame / before.clip_length
            first, second = (render_model(model, view, clip_time, reach=reach) for model in (before, after))
            largest = max(largest, float((first - second).abs().max()))
    return largest
