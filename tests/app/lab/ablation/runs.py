"""Ablations on the tiny capture with the fake training; figures and frame rates are made up, their number counted."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from app.cli import frame_rate_arguments
from app.evaluation.headless import TrainedProject
from app.evaluation.speed.frame_rates import FrameRates
from app.evaluation.speed.laps import RenderRate
from app.lab.ablation import measuring
from app.lab.ablation.running import Callbacks, run_ablation
from app.lab.ablation.variants import VARIANTS, chosen_variants
from app.project.opening.project_access import default_settings
from engine.capture.capture import Capture
from engine.metrics.clips.seams import PairRow
from tests.app.conftest import inline
from tests.app.fakes import make_fake

BASE: dict[str, Any] = {"joint_steps": 6, "source_steps": 4}
RATES = FrameRates("0", 32, 24, RenderRate(12.5, 30.0, 500, 3, "CPU rasterizer, 2 threads"), None, "no driver")
BY_NAME = {variant.name: variant for variant in VARIANTS}


def pair(frame: int, static: float) -> dict[str, Any]:
    return PairRow(frame, 0, "0", True, False, static, None, 0.0, None, static, None, 1.0).as_dict()


class Runner:
    """Runs ablations on the tiny capture with the fake training; measuring is counted, not done."""

    def __init__(self, folder: Path, capture: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder, self.capture = folder, capture
        self.settings = default_settings(capture, clip_length=4, overrides=BASE)
        self.launched: list[tuple[str, int]] = []
        self.measured: list[str] = []
        self.rated: list[str] = []
        self.outcomes: list[str] = []
        self.make_training = make_fake
        monkeypatch.setattr(measuring, "evaluate_project", self._evaluate)
        monkeypatch.setattr(frame_rate_arguments, "frame_rates", self._rates)
        monkeypatch.setattr("app.evaluation.headless.POLL_EVERY_S", 0.0)

    def _evaluate(self, opened, *, clip_indices, cameras, metrics, precision, on_progress) -> dict[str, Any]:
        self.measured.append(opened.project.folder.name)
        assert list(cameras) == [0]
        means = {"psnr": 20.0 + len(clip_indices), "ssim": 0.5, "curves": {"not": "a figure"}}
        rows = [pair(frame, 0.04 if frame == 4 else 0.02) for frame in range(1, 6)]
        source_steps = opened.project.settings.config().source_steps  # more of them are better, and take longer
        per_clip = {str(i): {"held_out": {"psnr": 20.0 + source_steps / 10, "psnr_moving": None}} for i in clip_indices}
        return {"means": {"held_out": means, "trained_on": {}, "clips": per_clip}, "seams": {"rows": rows}}

    def _rates(self, opened: TrainedProject) -> FrameRates:
        self.rated.append(opened.project.folder.name)
        return RATES

    def _launch(self, job, project):
        self.launched.append((project.folder.name, job.clip_index))
        return inline(job, project, make_training=self.make_training)

    def run(self, names: list[str] | None = None, **changes: Any) -> dict[str, Any]:
        arguments: dict[str, Any] = {"variants": chosen_variants(names), "n_clips": 2, "seeds": [0]}
        nothing = lambda *_: None  # noqa: E731
        return run_ablation(
            self.folder,
            self.capture,
            changes.pop("settings", self.settings),
            metrics="quick",
            launch=self._launch,
            callbacks=Callbacks(
                nothing, nothing, nothing, lambda outcome: self.outcomes.append(outcome.state), nothing
            ),
            **(arguments | changes),
        )
