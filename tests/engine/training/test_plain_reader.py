"""docs/examples/read_clip.py, numpy and nothing else, decodes what the program decodes."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from engine.backends.table import backend_called
from engine.clip_files.clip_state import ClipState, read_clip_state
from engine.clip_files.compact import compact_clip, write_compact_clip
from engine.model.reading import load_clip_model
from tests.engine.training.tiny_training import Tiny

pytestmark = pytest.mark.slow

READER = runpy.run_path(str(Path(__file__).parents[3] / "docs" / "examples" / "read_clip.py"))
ROUNDING = 3e-6
"""Of float32 sums in the program: the reader adds in float64."""


@pytest.fixture(scope="module")
def reference(tiny: Tiny, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("plain") / "clips" / "0000.safetensors"
    path.parent.mkdir()
    write_compact_clip(path, compact_clip(tiny.reference))
    return path


def assert_same_frames(path: Path, reference: Path) -> None:
    base, state = read_clip_state(reference), read_clip_state(path)
    model = load_clip_model(state, None if state.is_reference else base, backend=backend_called("reference"))
    header, arrays = READER["read_clip"](path)
    for frame in range(state.header.n_frames):
        found = READER["decode"](header, arrays, READER["read_clip"](reference)[1], frame)
        expected = model.decode(frame / state.header.clip_length)
        assert len(expected) == len(found["means"]) > 0
        for name in ("means", "scales", "opacities", "colors"):
            values = getattr(expected, name).numpy()
            np.testing.assert_allclose(found[name].reshape(values.shape), values, atol=ROUNDING, rtol=ROUNDING)
        quats = expected.quats.numpy() / np.linalg.norm(expected.quats.numpy(), axis=1, keepdims=True)
        np.testing.assert_allclose(found["quats"], quats, atol=ROUNDING)


def test_the_reference_clip(reference: Path):
    assert_same_frames(reference, reference)


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"field_tables": "shared"},
        {"field_form": "published"},
        {"decoder": "finetune"},
        {"inherit": "trainable"},
        {"residual": "none"},
    ],
    ids=str,
)
def test_source_clips(tiny: Tiny, reference: Path, tmp_path: Path, settings: dict[str, Any]):
    base = read_clip_state(reference)
    training = tiny.prepared(1, reference=base, prep_dir=tmp_path / "prep", **settings)
    while not training.is_finished:
        training.step()
    write_compact_clip(tmp_path / "clip.safetensors", compact_clip(training.state()))
    assert_same_frames(tmp_path / "clip.safetensors", reference)


def test_hidden_anchors_and_light(tiny: Tiny, reference: Path, tmp_path: Path):
    base = read_clip_state(reference)
    source = tiny.trained(1, reference=base, prep_dir=tmp_path / "prep")
    random = np.random.default_rng(0)
    n_static = base.header.n_anchors["static"]
    said = {
        "inherited.static.is_hidden": random.random(n_static) < 0.3,
        "inherited.static.light": random.normal(0, 0.2, (n_static, 2)).astype(np.float32),
    }
    state = ClipState(source.arrays | said, replace(source.header))
    write_compact_clip(tmp_path / "clip.safetensors", compact_clip(state))
    assert_same_frames(tmp_path / "clip.safetensors", reference)


def test_a_frame_of_a_project_by_its_number(tiny: Tiny, reference: Path, tmp_path: Path):
    project = reference.parents[1]
    (project / "project.json").write_text('{"schema": 2, "settings": {"clip_length": 4, "reference_clip": 0}}')
    write_compact_clip(
        project / "clips" / "0001.safetensors",
        compact_clip(tiny.trained(1, reference=read_clip_state(reference), prep_dir=tmp_path / "prep")),
    )
    found = READER["read_frame"](project, 6)
    header, arrays = READER["read_clip"](project / "clips" / "0001.safetensors")
    expected = READER["decode"](header, arrays, READER["read_clip"](reference)[1], 2)
    assert all(np.array_equal(found[name], expected[name]) for name in expected)
