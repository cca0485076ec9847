"""A tiny capture and a tiny training for tests of the application: real files that the window can show, real messages,
no torch, no clouds.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.project.opening.opened_project import OpenedProject
from app.training.messages import TrainJob
from app.training.store import ClipStore
from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.clip_files.clip_state import ClipState, read_clip_state, write_clip_state
from engine.clip_files.compact import CompactClip, compact_clip
from engine.errors import NonFiniteLoss, ProjectError
from engine.progress import Progress, StepStats
from tests.clip_headers import DECODER, make_header
from tests.engine.capture.small_ring import look_at as look_at
from tests.engine.capture.small_ring import ring as ring
from tests.engine.capture.small_ring import write_capture as write_capture

N_STEPS = 6
N_ANCHORS = 12
HEADS = {"opacity": 1, "color": 3, "shape": 7, "offset": 3}


def anchor_arrays(role: str) -> dict[str, np.ndarray]:
    """Anchors on a diagonal that exist at all times, as a clip file names them."""
    positions = np.linspace(0, 1, 3 * N_ANCHORS, dtype=np.float32).reshape(N_ANCHORS, 3)
    log_scales = np.full((N_ANCHORS, 3), -2.0, np.float32)
    return {
        f"sets.{role}.positions": positions,
        f"sets.{role}.color_logits": positions - 0.5,
        f"sets.{role}.features": np.zeros((N_ANCHORS, DECODER["static_dim"]), np.float32),
        f"sets.{role}.log_offset_scales": log_scales,
        f"sets.{role}.log_base_scales": log_scales,
    }


def decoder_arrays() -> dict[str, np.ndarray]:
    """Heads that give every anchor one Gaussian of its own colour, unrotated."""
    hidden, n_in = DECODER["hidden"], DECODER["static_dim"] + DECODER["dynamic_dim"]
    arrays = {}
    for head, width in HEADS.items():
        arrays[f"decoder.first.{head}"] = np.zeros((n_in, hidden), np.float32)
        arrays[f"decoder.first_bias.{head}"] = np.zeros(hidden, np.float32)
        arrays[f"decoder.second.{head}"] = np.zeros((hidden, width), np.float32)
        arrays[f"decoder.second_bias.{head}"] = np.zeros(width, np.float32)
    arrays["decoder.second_bias.shape"][3] = 1.0
    return arrays


@dataclass
class FakeTraining:
    """Counts steps and keeps one number that depends on every step, so that resuming wrongly would show."""

    capture: Capture
    clip: Clip
    reference: ClipState | None
    report: Callable[[Progress], None]
    n_steps: int = N_STEPS
    fails_at: int | None = None
    steps_done: int = 0
    value: float = 0.0
    previous: ClipState | None = None

    @property
    def is_finished(self) -> bool:
        return self.steps_done >= self.n_steps

    def prepare(self) -> None:
        for share in (0.0, 0.5, 1.0):
            self.report(Progress("Building the cloud", share, f"{share:.0%} of 12 points"))

    def step(self, n: int = 1) -> StepStats:
        if self.fails_at is not None and self.steps_done == self.fails_at:
            raise NonFiniteLoss(f"The loss became nan at step {self.steps_done + 1}.", hint="Lower the rates.")
        norms = []
        for _ in range(min(n, self.n_steps - self.steps_done)):
            self.steps_done += 1
            self.value = self.value * 0.5 + self.steps_done
            norms.append(float(self.steps_done))
        return StepStats(self.steps_done, self.n_steps, 1.0 / self.steps_done, 20.0, 12, "joint", tuple(norms))

    def state(self) -> ClipState:
        reference, previous = self.reference, self.previous
        header = make_header(
            role="reference" if reference is None else "source",
            clip_index=self.clip.clip_index,
            clip_length=self.clip.clip_length,
            n_frames=self.clip.n_frames,
            start=self.clip.start,
            step=self.steps_done,
            n_steps=self.n_steps,
            n_anchors={"static": N_ANCHORS} | ({} if reference is None else {"residual": N_ANCHORS}),
            reference_fingerprint=None if reference is None else reference.header.fingerprint,
            previous_fingerprint=None if previous is None else previous.header.fingerprint,
        )
        arrays = anchor_arrays("static" if reference is None else "residual")
        arrays["value"] = np.array([self.value], np.float32)
        if reference is None:
            arrays |= decoder_arrays() | {"gains": np.ones((0, 3), np.float32)}
        return ClipState(arrays, header).stamped()

    def finish(self) -> CompactClip:
        return compact_clip(self.state())

    def write_checkpoint(self, path: Path | str) -> None:
        write_clip_state(path, self.state())

    def restore_checkpoint(self, path: Path | str) -> None:
        kept = read_clip_state(path)
        if kept.header.clip_index != self.clip.clip_index:
            raise ProjectError("The checkpoint belongs to another clip.", path=path)
        self.steps_done, self.value = kept.header.step, float(kept.arrays["value"][0])

    def held_out_psnr(self) -> float:
        return 20.0 + self.steps_done


def write_trained(opened: OpenedProject, clip_index: int, *, n_steps: int = N_STEPS) -> Path:
    """A finished clip of an open project, as the fake trains it."""
    reference = None if clip_index == 0 else read_clip_state(opened.project.clip_path(0))
    training = FakeTraining(opened.capture, opened.clips[clip_index], reference, lambda _: None, n_steps=n_steps)
    for _ in range(n_steps):
        training.step()
    path = opened.project.clip_path(clip_index)
    path.parent.mkdir(exist_ok=True)
    write_clip_state(path, training.state())
    return path


def make_fake(job: TrainJob, store: ClipStore, report: Callable[[Progress], None]) -> FakeTraining:
    """Builds a FakeTraining from a job as the real builder would. Overrides go unused but `joint_steps` sets n_steps
    and `static_steps` the step that fails."""
    fails_at = job.overrides.get("static_steps")
    return FakeTraining(
        store.capture(scale=job.scale, frames=job.frames),
        job.clip,
        None if job.reference is None else store.clip(job.reference),
        report,
        n_steps=int(job.overrides.get("joint_steps") or N_STEPS),
        fails_at=None if fails_at is None else int(fails_at),
        previous=None if job.previous is None else store.clip(job.previous),
    )


def make_slow(job: TrainJob, store: ClipStore, report: Callable[[Progress], None]) -> FakeTraining:
    """Like make_fake, with more steps than any test waits for."""
    training = make_fake(job, store, report)
    training.n_steps = 10_000_000
    return training


def make_telling(job: TrainJob, store: ClipStore, report: Callable[[Progress], None]) -> FakeTraining:
    """Like make_fake; the environment of its process goes to a file in the project."""
    (store.shared.parent / "environment.json").write_text(json.dumps(dict(os.environ)))
    return make_fake(job, store, report)


def make_crashing(job: TrainJob, store: ClipStore, report: Callable[[Progress], None]) -> FakeTraining:
    """Ends its process without a word."""
    import signal

    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError("not reached")
