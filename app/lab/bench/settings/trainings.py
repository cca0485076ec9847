"""Settings of a training that trade time for error: each is trained on a small capture, with all others at their
defaults."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from app.evaluation.headless import TrainedProject, open_trained
from app.lab.ablation.running import Callbacks, project_folder, run_ablation
from app.lab.ablation.variants import FULL, Variant, chosen_variants, own_row
from app.lab.bench.rows import DEFAULTS, Trade
from app.project.opening.project_access import default_settings, open_project
from app.project.project_facts import read_facts
from app.training.service import Launch
from engine.capture.capture import Capture
from engine.errors import ProjectError
from engine.training.presets import PRESETS

CLIP_LENGTH, N_CLIPS = 5, 2


class ShortTrainings:
    """Two short clips of a capture, trained again and again.

    Args:
        capture: At its working size.
    Raises:
        ProjectError: The capture is too short or has no held-out camera.
    """

    def __init__(self, capture: Capture) -> None:
        self._capture = capture
        self._settings = default_settings(capture, clip_length=min(CLIP_LENGTH, capture.n_frames))
        if capture.n_frames <= CLIP_LENGTH or not self._settings.holdout:
            raise ProjectError(
                f"The capture has {capture.n_frames} frames and {len(self._settings.holdout)} held-out cameras; more "
                f"than {CLIP_LENGTH} frames and a held-out camera are needed to measure settings.",
                path=Path(capture.path),
            )

    def measure(
        self,
        folder: Path,
        chosen: Mapping[str, Sequence[str]],
        *,
        launch: Launch,
        say: Callable[[str, float], None] = lambda what, done: None,
    ) -> tuple[list[Trade], TrainedProject]:
        """Train with each setting and with the defaults.

        Args:
            folder: Gets a project per setting; trainings that are complete in it are not repeated.
            chosen: Settings by operation, see Plan. A step is one of the later clip; times of a clip are those of both.
            say: Called before each training, with the share that is done.
        Returns:
            The marks of the chart, and the project trained with the defaults.
        Raises:
            ProjectError: The folder holds other projects.
            TrainingError: A clip failed.
        """
        variants = {setting: _variant(setting) for row in chosen.values() for setting in row}
        document = run_ablation(
            folder,
            self._capture,
            self._settings,
            variants=[*chosen_variants([]), *variants.values()],
            n_clips=N_CLIPS,
            seeds=[self._settings.seed],
            metrics="quick",
            launch=launch,
            callbacks=Callbacks(
                on_variant=lambda name, seed, n_done, n: say(f"training, {name}", n_done / n),
                on_status=_ignore,
                on_event=_ignore,
                on_outcome=_ignore,
                on_row=_ignore,
            ),
        )
        found = {result["variant"]: result for result in document["results"]}
        names = {setting: variant.name for setting, variant in variants.items()} | {DEFAULTS: FULL}
        trades = []
        for operation, row in chosen.items():
            lines = {setting: setting.partition("=")[0] for setting in row}
            marks = [*lines.items(), *((DEFAULTS, line) for line in dict.fromkeys(lines.values()))]
            for setting, line in marks:
                place = project_folder(folder, names[setting], self._settings.seed)
                trades.append(_trade(operation, line, setting, place, found[names[setting]]))
        full = open_project(project_folder(folder, FULL, self._settings.seed), is_writable=False)
        return trades, open_trained(full, self._capture)


def _variant(setting: str) -> Variant:
    name, _, value = setting.partition("=")
    changed = PRESETS[value] if name == "preset" else {name: value}
    return own_row(f"{name}.{value}: {' '.join(f'{key}={changed[key]}' for key in changed)}")


def _trade(operation: str, line: str, setting: str, place: Path, result: dict[str, Any]) -> Trade:
    clips = read_facts(place, place.name).clips
    prefix, n_steps = "", 1
    if operation == "step":
        clips = clips[-1:]
        prefix, n_steps = "later_", clips[0].n_steps
    return Trade(
        operation=operation,
        line=line,
        setting=setting,
        seconds=sum(clip.training_s or 0.0 for clip in clips) / n_steps,
        n_bytes=sum(sum(clip.storage.values()) for clip in clips),
        psnr_db=result[f"{prefix}psnr"],
        psnr_moving_db=result.get(f"{prefix}psnr_moving"),
    )


def _ignore(*_news: object) -> None:
    """Progress within a training."""
