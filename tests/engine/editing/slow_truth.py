"""What edits mean, written out: one Gaussian after another, in float64 and without any cleverness."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from engine.camera.rotations import matrices_of, quat_product
from engine.capture.clip import Clip
from engine.editing.actions import Delete, Expose, Hide, Hold, Recolor, Smooth, Transform
from engine.editing.edit import Box, Everything, Picked, Prism, Sphere, TargetOfMoment
from engine.editing.effects import Effect
from engine.editing.picks import unpack_rows
from engine.images.srgb import encoded_of, linear_of
from engine.model.clip_model import ClipModel

Name = tuple[str, int]
"""role and number"""


@dataclass(frozen=True)
class One:
    """One Gaussian."""

    mean: np.ndarray
    quat: np.ndarray
    scale: np.ndarray
    opacity: float
    color: np.ndarray


class SlowTruth:
    """Edits of one clip.

    Args:
        names: Origin and clip of each role.
        reference_roles: Roles that come from the reference clip.
    """

    def __init__(
        self, model: ClipModel, clip: Clip, names: dict[str, tuple[str, int]], reference_roles: set[str]
    ) -> None:
        self.model, self.clip, self.names, self.reference_roles = model, clip, names, reference_roles

    def at(self, effects: tuple[Effect, ...], clip_time: float, alive_at: float | None = None) -> dict[Name, One]:
        """What is left of the clip at a time of it, by name."""
        if not effects:
            return self._raw(clip_time, clip_time if alive_at is None else alive_at)
        effect, before = effects[-1], effects[:-1]
        now, action = self.at(before, clip_time, alive_at), effect.action
        if isinstance(action, Hide | Delete):
            return {name: one for name, one in now.items() if not self._is_meant(effect, name, one)}
        if isinstance(action, Hold):
            return self._held(effect, action, before, now)
        if isinstance(action, Smooth):
            return self._smoothed(effect, action, before, now, clip_time)
        return {name: _changed(one, action) if self._is_meant(effect, name, one) else one for name, one in now.items()}

    def _raw(self, clip_time: float, alive_at: float) -> dict[Name, One]:
        k, found = self.model.decoder.gaussians_per_anchor, {}
        rows = {role: self.model.alive(role, alive_at) for role in self.model.roles()}
        columns = [tensor.double().numpy() for tensor in self.model.decode(clip_time, rows).tensors()]
        place = 0
        for role in self.model.roles():
            is_hidden = self.model.hidden.get(role)
            shown = range(10**6) if is_hidden is None else [i for i, hidden in enumerate(is_hidden) if not hidden]
            for row in rows[role].tolist():
                for among_k in range(k):
                    mean, quat, scale, opacity, color = (column[place] for column in columns)
                    found[role, shown[row] * k + among_k] = One(mean, quat, scale, float(opacity), color)
                    place += 1
        return found

    def _is_meant(self, effect: Effect, name: Name, one: One) -> bool:
        role, number = name
        if effect.is_reference_only and role not in self.reference_roles:
            return False
        is_in = self._is_in(effect.target, role, number, one)
        return False if is_in is None else is_in != effect.is_inverted

    def _is_in(self, target: TargetOfMoment, role: str, number: int, one: One) -> bool | None:
        """None where the target stands for nothing in this clip."""
        match target:
            case Everything():
                return True
            case Box():
                along = matrices_of(np.array(target.quat)).T @ (one.mean - np.array(target.center))
                return bool((np.abs(along) <= np.array(target.half_sizes)).all())
            case Sphere():
                away = one.mean - np.array(target.center)
                return bool(math.sqrt(away @ away) <= target.radius) if np.isfinite(away).all() else False
            case Prism():
                return is_in_prism(target, one.mean)
            case Picked():
                clips = {clip_index for _, clip_index in self.names.values()}
                here = [known for known in target.sets if known.clip_index in clips]
                is_known = [self.names.get(known.role, ("", -1))[0] == known.origin for known in here]
                if here and not any(is_known):
                    return None
                return any(
                    known.role == role
                    and known.origin == self.names[role][0]
                    and number in unpack_rows(known.rows).tolist()
                    for known in target.sets
                )

    def _held(self, effect: Effect, action: Hold, before: tuple[Effect, ...], now: dict[Name, One]) -> dict[Name, One]:
        frame = min(max(action.frame_index, self.clip.start), self.clip.stop - 1)
        then = self.at(before, self.clip.clip_time(frame))
        result = {}
        for name in now.keys() | then.keys():
            if name in then:
                if self._is_meant(effect, name, then[name]):
                    result[name] = then[name]
                elif name in now:
                    result[name] = now[name]
            elif not self._is_meant(effect, name, now[name]):
                result[name] = now[name]
        return result

    def _smoothed(
        self, effect: Effect, action: Smooth, before: tuple[Effect, ...], now: dict[Name, One], clip_time: float
    ) -> dict[Name, One]:
        position = min(max(clip_time * self.clip.clip_length, 0.0), self.clip.n_frames - 1.0)
        reach = max(3.0 * action.sigma_frames, 1.0)
        frames = [frame for frame in range(self.clip.n_frames) if abs(frame - position) <= reach]
        frames.sort(key=lambda frame: (abs(frame - position), frame))
        states = [self.at(before, frame / self.clip.clip_length) for frame in frames]
        weights = [math.exp(-0.5 * ((frame - position) / action.sigma_frames) ** 2) for frame in frames]
        result = {}
        for name in {*now, *(name for state in states for name in state)}:
            nearest = now.get(name) or next(state[name] for state in states if name in state)
            if name[0] == "static" or not self._is_meant(effect, name, nearest):
                if name in now:
                    result[name] = now[name]
                continue
            found = [
                (weight, state[name])
                for weight, state in zip(weights, states, strict=True)
                if name in state and _is_finite(state[name])
            ]
            if found:
                result[name] = _mean(found, sum(weights))
        return result


def is_in_prism(prism: Prism, mean: np.ndarray) -> bool:
    """Whether the outline, cut at the depth of a point, goes around it: by the angle that it sweeps."""
    x, y, z = matrices_of(np.array(prism.quat)).T @ (mean - np.array(prism.center))
    if not np.isfinite(mean).all() or abs(z) > prism.half_sizes[2]:
        return False
    width = 1.0 if prism.apex is None else 1.0 + z / (prism.apex * prism.half_sizes[2])
    corners = [(u * prism.half_sizes[0] * width - x, v * prism.half_sizes[1] * width - y) for u, v in prism.outline]
    swept = 0.0
    for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
        swept += math.atan2(ax * by - ay * bx, ax * bx + ay * by)
    return abs(swept) > math.pi


def _is_finite(one: One) -> bool:
    values = [*one.mean, *one.quat, *one.scale, one.opacity, *one.color]
    return all(math.isfinite(value) for value in values)


def _mean(found: list[tuple[float, One]], all_weights: float) -> One:
    total = sum(weight for weight, _ in found)
    first = found[0][1].quat / np.linalg.norm(found[0][1].quat)
    quat = np.zeros(4)
    for weight, one in found:
        unit = one.quat / np.linalg.norm(one.quat)
        quat = quat + weight * (unit if unit @ first >= 0 else -unit)
    return One(
        np.sum([weight * one.mean for weight, one in found], axis=0) / total,
        quat / np.linalg.norm(quat),
        np.exp(np.sum([weight * np.log(one.scale) for weight, one in found], axis=0) / total),
        sum(weight * one.opacity for weight, one in found) / all_weights,
        np.sum([weight * one.color for weight, one in found], axis=0) / total,
    )


def _changed(one: One, action: Transform | Recolor | Expose) -> One:
    match action:
        case Transform():
            pivot, quat = np.array(action.pivot), np.array(action.quat)
            mean = pivot + action.scale * (matrices_of(quat) @ (one.mean - pivot)) + np.array(action.translation)
            return replace(one, mean=mean, quat=quat_product(quat, one.quat), scale=one.scale * action.scale)
        case Expose():
            light = linear_of(np.maximum(one.color, 0.0)) * 2.0**action.stops
            return replace(one, color=np.clip(encoded_of(light), 0.0, 1.0))
        case Recolor():
            mixed = (1.0 - action.tint_share) * one.color + action.tint_share * np.array(action.tint)
            grey = 0.2126 * mixed[0] + 0.7152 * mixed[1] + 0.0722 * mixed[2]
            color = (grey + action.saturation * (mixed - grey)) * np.array(action.gains)
            return replace(one, color=np.clip(color, 0.0, 1.0), opacity=min(max(one.opacity * action.opacity, 0), 1))
