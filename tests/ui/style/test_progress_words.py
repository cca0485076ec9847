"""Percent are of steps, stages are counted, and panel and timeline say the same."""

from __future__ import annotations

from pathlib import Path

import engine.training
from app.status import ClipStatus, TrainingStatus
from app.training.stage_order import REFERENCE_STAGES, SOURCE_STAGES, stage_number
from ui.style.progress_words import band_words, stage_words


def test_a_preparation_is_counted_in_stages_and_never_in_percent() -> None:
    training = TrainingStatus(
        state="preparing", clip_index=2, stage="Carving what moves", stage_number=4, n_stages=6, progress=1.0
    )
    for words in (stage_words(training), band_words(ClipStatus("preparing"), training, 2, "preparing")):
        assert ("4 of 6" in words, "%" in words) == (True, False)
    assert band_words(ClipStatus("queued"), training, 3, "waiting") == "waiting"


def test_steps_are_counted_in_percent_once_there_are_any() -> None:
    training = TrainingStatus(state="running", clip_index=2, stage="Learning what is new")
    assert "19 %" in band_words(ClipStatus("training", 0.19), training, 2, "training")
    assert "%" not in band_words(ClipStatus("paused", 0.0), training, 2, "paused")
    assert "50 %" in band_words(ClipStatus("stopped", 0.5), training, 1, "stopped")


def test_stages_are_counted_from_one_and_what_is_not_always_there_is_not_counted() -> None:
    for stages, is_reference in ((REFERENCE_STAGES, True), (SOURCE_STAGES, False)):
        numbers = [stage_number(stage, is_reference=is_reference) for stage in stages]
        assert numbers == [(i + 1, len(stages)) for i in range(len(stages))]
        assert stage_number("Compiling kernels, first start only", is_reference=is_reference) == (0, 0)


def test_every_counted_stage_is_one_that_a_preparation_reports() -> None:
    folder = Path(engine.training.__file__).parent
    told = "".join(path.read_text() for path in folder.rglob("*.py"))
    assert [stage for stage in (*REFERENCE_STAGES, *SOURCE_STAGES) if f'"{stage}"' not in told] == []
