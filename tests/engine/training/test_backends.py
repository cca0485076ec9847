"""Whole trainings by every back end: a reference clip and a source clip over it, of a few steps and a few anchors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from engine.backends.backend import Backend
from engine.backends.reference.backend import ReferenceBackend
from engine.backends.table import backend_called
from engine.clip_files.clip_state import ClipState
from tests.engine.backends.counting.backend import CountingBackend
from tests.engine.training.tiny_training import Tiny, make_training, take_steps

pytestmark = pytest.mark.slow  # left out by make check, as the file takes seconds as a whole

SIZES: dict[str, Any] = {
    "static_steps": 2,
    "joint_steps": 2,
    "source_steps": 3,
    "max_static_points": 60,
    "max_moving_points": 40,
    "gaussians_per_anchor": 2,
}
"""So small that the brute force of the reference takes hundredths of a second a step."""
OPERATIONS = {
    "rasterize",
    "tile_boxes",
    "decode",
    "join",
    "photometric_loss",
    "tile_squares",
    "volume_sum",
    "adam",
}


def train(
    tiny: Tiny, backend: Backend, clip_index: int, reference: ClipState | None, prep_dir: Path
) -> tuple[list[float], ClipState]:
    """Losses of all steps, and the clip as it is stored."""
    training = make_training(
        tiny.capture,
        tiny.holdout,
        clip=tiny.clips[clip_index],
        reference=reference,
        prep_dir=prep_dir,
        backend=backend,
        **SIZES,
    )
    training.prepare()
    losses = []
    while not training.is_finished:
        losses.append(training.step().loss)
    learned = [*training.model.parameters(), training.gains]
    assert all(p.dtype == backend.dtype and p.device == backend.device for p in learned)
    return losses, training.finish().state


@pytest.fixture(scope="module")
def by_kernels(tiny, small_backdrop, tmp_path_factory) -> list[tuple[list[float], ClipState]]:
    """Clips 0 and 1 by the compiled kernels."""
    folder = tmp_path_factory.getbasetemp() / "by_kernels"
    first = train(tiny, backend_called("cpu"), 0, None, folder)
    return [first, train(tiny, backend_called("cpu"), 1, first[1], folder)]


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64], ids=str)
def test_plain_torch_learns_the_same_but_for_rounding(tiny, by_kernels, tmp_path, tmp_path_factory, dtype):
    backend = ReferenceBackend(dtype=dtype)
    reference = by_kernels[0][1]
    found = [train(tiny, backend, 0, None, tmp_path / "own")]
    found.append(train(tiny, backend, 1, reference, tmp_path_factory.getbasetemp() / "by_kernels"))
    for (losses, state), (expected_losses, expected) in zip(found, by_kernels, strict=True):
        # float32 differs from step to step by 1e-6, and a hundred times that after steps of Adam along its sign
        assert losses == pytest.approx(expected_losses, rel=1e-3)
        assert state.arrays.keys() == expected.arrays.keys()
        for name, array in expected.arrays.items():
            assert array.dtype == state.arrays[name].dtype, name
            assert array.shape == state.arrays[name].shape, name
            # first steps of Adam have the size of the rate, whatever that of the gradient: where one is zero but for
            # rounding, a parameter may go the other way
            is_other = np.abs(array.astype(float) - state.arrays[name]) > 2e-3
            assert is_other.mean() < 0.03, name


def test_a_training_asks_its_back_end_for_everything(tiny, by_kernels, tmp_path):
    backend = CountingBackend()
    train(tiny, backend, 1, by_kernels[0][1], tmp_path)
    assert set(backend.n_calls) == OPERATIONS
    assert backend.n_calls["adam"] == 1
    assert backend.n_calls["photometric_loss"] == SIZES["source_steps"]


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64], ids=str)
def test_a_training_in_plain_torch_goes_on_from_a_checkpoint(tiny, by_kernels, tmp_path, dtype):
    given = {"clip": tiny.clips[1], "reference": by_kernels[0][1], "prep_dir": tmp_path, **SIZES}
    backend = ReferenceBackend(dtype=dtype)
    straight = make_training(tiny.capture, tiny.holdout, backend=backend, **given)
    straight.prepare()
    take_steps(straight, 1)
    straight.write_checkpoint(tmp_path / "kept.safetensors")
    resumed = make_training(tiny.capture, tiny.holdout, backend=backend, **given)
    resumed.restore_checkpoint(tmp_path / "kept.safetensors")
    losses = [[training.step().loss for _ in range(2)] for training in (straight, resumed)]
    # files hold float32, so float64 goes on from rounded numbers
    assert losses[1] == (losses[0] if dtype == torch.float32 else pytest.approx(losses[0], rel=1e-5))
