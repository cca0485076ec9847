"""The end of a training: the model takes over what is stored, and that is what comes back from disk."""

from __future__ import annotations

import numpy as np
import pytest

from engine.backends.table import backend_called
from engine.clip_files.clip_state import read_clip_state
from engine.clip_files.compact import write_compact_clip
from engine.model.reading import load_clip_model
from tests.engine.training.tiny_training import Tiny, finish, live_picture, picture, take_steps

pytestmark = pytest.mark.slow


def n_bytes(arrays: dict[str, np.ndarray]) -> int:
    return sum(array.nbytes for array in arrays.values())


def test_a_reference_and_a_clip_trained_on_it_show_the_stored_pixels(tiny: Tiny, tmp_path):
    reference = None
    for clip_index in (0, 1):
        training = tiny.prepared(clip_index, reference=reference, prep_dir=tmp_path)
        trained = finish(training)
        before, quality = live_picture(tiny, training), training.held_out_psnr()
        compact = training.finish()
        path = tmp_path / f"{clip_index}.safetensors"
        write_compact_clip(path, compact)
        again = read_clip_state(path)
        shown = picture(tiny, again, reference)
        assert np.array_equal(shown, live_picture(tiny, training))  # measured after the end: what is stored
        assert np.abs(shown - before).mean() < 2e-3
        assert abs(training.held_out_psnr() - quality) < 0.05
        # worst: 0.27 of the reference (16 bits a value), 0.13 of the source clip
        assert path.stat().st_size < (0.4 if clip_index == 0 else 0.25) * n_bytes(trained.arrays)
        if reference is not None:
            assert again.header.reference_fingerprint == reference.fingerprint == reference.header.fingerprint
        reference = reference or again


@pytest.mark.parametrize(
    "settings",
    [{"inherit": "trainable"}, {"inherit": "off"}, {"decoder": "finetune"}, {"residual": "none"}],
)
def test_whatever_a_clip_owns_is_stored(tiny: Tiny, tmp_path, settings):
    training = take_steps(tiny.prepared(1, **settings), 2)
    names = training.state().arrays.keys()
    write_compact_clip(tmp_path / "0001.safetensors", training.finish())
    again = read_clip_state(tmp_path / "0001.safetensors")
    assert again.arrays.keys() == names == training.state().arrays.keys()
    assert np.array_equal(picture(tiny, again, tiny.reference), live_picture(tiny, training))


def test_a_field_that_goes_on_keeps_entries_that_only_other_clips_read(tiny: Tiny):
    kept = {}
    for field in ("per_clip", "continue"):
        training = tiny.prepared(1, field=field, previous=tiny.reference)
        used = load_clip_model(training.state(), tiny.reference, backend=backend_called("cpu")).entries_in_use()[0]
        table = training.finish().state.arrays["field.tables.0"]
        kept[field] = int((table != 0).any(-1)[~used].sum())
    assert kept["per_clip"] == 0
    assert kept["continue"] > 0


def test_a_training_that_was_stopped_ends_as_one_that_was_not(tiny: Tiny, tmp_path):
    straight = tiny.prepared(1)
    finish(straight)
    stopped = take_steps(tiny.prepared(1), 3)
    stopped.write_checkpoint(tmp_path / "kept.safetensors")
    resumed = tiny.training(1)
    resumed.restore_checkpoint(tmp_path / "kept.safetensors")
    finish(resumed)
    assert resumed.finish().state.fingerprint == straight.finish().state.fingerprint
