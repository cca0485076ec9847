"""Forecast of a clip: the cost model, corrected by what earlier clips of the project took, or by the machine's speed.

Clips of the same kind count before those of the other kind, and a measured clip before a measured machine. The
correction is a factor: the middle of measured over modelled. No torch, no clock, no files.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from engine.capture.clip import Clip
from engine.clip_files.clip_header import ClipHeader
from engine.training.config import TrainConfig
from engine.training.plan.cost import ClipSizes, disk_mb, memory_mb, preparation_s, step_ms
from engine.training.plan.expected_sizes import Counts, Footage, clip_sizes, counts_of, expected_counts

_KEEPING_SHARE = 0.03
"""Of the steps' time: held-out figures, snapshots and checkpoints between them."""
_OTHER_KIND = (0.5, 2.0)
"""How far a clip of the other kind may correct: it does other work."""


@dataclass(frozen=True, slots=True)
class MeasuredClip:
    """A trained clip of the same project, and what it took; None where that was not recorded.

    Attributes:
        is_source: Whether it began with what another clip had learned.
        n_frames, n_steps: As trained.
        preparation_s: Without compiling kernels.
    """

    clip_index: int
    is_source: bool
    n_frames: int
    n_steps: int
    counts: Counts | None
    preparation_s: float | None
    training_s: float | None
    memory_mb: float | None
    disk_mb: float | None


def measured_clip(header: ClipHeader, *, disk_mb: float | None, uncounted_s: float = 0.0) -> MeasuredClip:
    """What a clip's file says.

    Args:
        header: Of the finished clip.
        disk_mb: Its size, 10^6 bytes.
        uncounted_s: Part of its preparation that does not come again, such as compiling.
    """
    figures = header.figures
    prepared_s = _positive(figures.preparation_s)
    return MeasuredClip(
        clip_index=header.clip_index,
        is_source=header.role == "source" or header.previous_fingerprint is not None,
        n_frames=header.n_frames,
        n_steps=header.step,
        counts=counts_of(header),
        preparation_s=None if prepared_s is None else max(prepared_s - uncounted_s, 0.1),
        training_s=_positive(figures.training_s),
        memory_mb=_positive(figures.memory_mb),
        disk_mb=disk_mb,
    )


def _positive(value: float | None) -> float | None:
    return value if value is not None and value > 0 else None


@dataclass(frozen=True, slots=True)
class MachineSpeed:
    """How this machine compares with the one of `engine.training.plan.cost`.

    Attributes:
        factor: Its times are this many times as long.
        reason: How that is known.
    """

    factor: float
    reason: str


UNKNOWN_MACHINE = MachineSpeed(1.0, "cost model of another machine, this one was not measured")


class Expected(NamedTuple):
    """A forecast number: value, unit and where it comes from."""

    value: float
    unit: str
    reason: str


@dataclass(frozen=True, slots=True)
class Forecast:
    """What a clip is expected to take."""

    preparation_s: Expected
    training_s: Expected
    memory_mb: Expected
    disk_mb: Expected


class _Work(NamedTuple):
    """A clip as the cost model sees it, and what it really took."""

    sizes: ClipSizes
    steps: Sequence[int]
    taken: MeasuredClip | None = None


def forecast(
    footage: Footage,
    clip: Clip,
    config: TrainConfig,
    sizes: ClipSizes,
    *,
    steps: Sequence[int],
    history: Sequence[MeasuredClip],
    machine: MachineSpeed,
) -> Forecast:
    """Forecast of one clip.

    Args:
        footage, clip, config: What it is made of.
        sizes: Of the clip.
        steps: Per phase.
        history: Other clips of the project.
        machine: Corrects times where no clip of the project was measured.
    """
    past = [_work_of(known, footage, clip, config) for known in history]
    work = _Work(sizes, steps)

    def expected(name: str, unit: str, model: Callable[[_Work], float], base: MachineSpeed) -> Expected:
        correction = _correction(name, past, sizes, model) or base
        return Expected(round(model(work) * correction.factor, 3), unit, correction.reason)

    plain = MachineSpeed(1.0, "from the sizes above")
    return Forecast(
        preparation_s=expected("preparation_s", "s", lambda w: preparation_s(w.sizes), machine),
        training_s=expected("training_s", "s", _steps_s, machine),
        memory_mb=expected("memory_mb", "MB", lambda w: memory_mb(w.sizes), plain),
        disk_mb=expected("disk_mb", "MB", lambda w: disk_mb(w.sizes), plain),
    )


def _work_of(known: MeasuredClip, footage: Footage, clip: Clip, config: TrainConfig) -> _Work:
    trained = Clip(known.clip_index, 0, known.n_frames, clip.clip_length)
    counts = known.counts or expected_counts(
        footage, trained, config, reference=None, siblings=(), is_source=known.is_source
    )
    n_static = 0 if known.is_source else min(config.n_static_steps(footage.n_cameras), known.n_steps)
    steps = (known.n_steps,) if known.is_source else (n_static, known.n_steps - n_static)
    return _Work(clip_sizes(footage, trained, config, counts, is_source=known.is_source), steps, known)


def _steps_s(work: _Work) -> float:
    phases = ("source",) if len(work.steps) == 1 else ("static", "joint")
    steps_ms = sum(n * step_ms(phase, work.sizes) for phase, n in zip(phases, work.steps, strict=True))
    return steps_ms / 1e3 * (1 + _KEEPING_SHARE)


def _correction(
    name: str, past: Sequence[_Work], sizes: ClipSizes, model: Callable[[_Work], float]
) -> MachineSpeed | None:
    """Measured over modelled of earlier clips; None where nothing was measured."""
    ratios: dict[bool, list[tuple[int, float]]] = {True: [], False: []}
    for work in past:
        assert work.taken is not None
        measured, modelled = getattr(work.taken, name), model(work)
        is_still = work.taken.counts is not None and not work.taken.counts.n_alive
        if name == "disk_mb" and is_still:  # names and numbers of a header, which no size stands for
            continue
        if measured and modelled > 0:
            ratios[work.taken.is_source].append((work.taken.clip_index, measured / modelled))
    same, other = ratios[sizes.is_source], ratios[not sizes.is_source]
    if name == "disk_mb":  # what a clip of the other kind stores, and with how many bits, says nothing
        other = []
    if not (same or other):
        return None
    factor = statistics.median(ratio for _, ratio in same or other)
    clips = _listed([clip_index for clip_index, _ in same or other])
    if same:
        return MachineSpeed(factor, f"as measured on {clips}, scaled by size")
    factor = min(max(factor, _OTHER_KIND[0]), _OTHER_KIND[1])
    return MachineSpeed(factor, f"cost model times {factor:.2f}, as measured on {clips} of the other kind")


def _listed(clip_indices: Sequence[int]) -> str:
    shown = sorted(clip_indices)
    if len(shown) == 1:
        return f"clip {shown[0]}"
    return f"{len(shown)} clips" if len(shown) > 3 else f"clips {', '.join(str(i) for i in shown[:-1])} and {shown[-1]}"
