"""Every byte of a clip file belongs to one component."""

import numpy as np
import pytest

from app.project.clips.clip_bytes import COMPONENT_NAMES, HEADER, OTHER, component_of, storage_of
from engine.clip_files.clip_state import ClipState, write_clip_state
from engine.errors import ProjectError
from tests.app.made_projects import clip_header


@pytest.mark.parametrize(
    ("name", "component"),
    [
        ("sets.static.positions", "positions"),
        ("sets.moving.log_base_scales", "scales"),
        ("sets.moving.presence", "presence"),
        ("inherited.moving.presence", "presence"),
        ("field.tables.0", "field tables"),
        ("field.network.0", "field network"),
        ("gains", "gains"),
        ("something.new", OTHER),
    ],
)
def test_names_of_arrays_tell_their_component(name, component):
    assert component_of(name) == component
    assert component in COMPONENT_NAMES


def test_components_add_up_to_the_size_of_the_file(tmp_path):
    arrays = {"sets.static.positions": np.zeros((7, 3), np.float32), "odd": np.zeros(5, np.uint8)}
    path = tmp_path / "a.safetensors"
    write_clip_state(path, ClipState(arrays, clip_header(0)))
    storage = storage_of(path)
    assert sum(storage.values()) == path.stat().st_size
    assert (storage["positions"], storage[OTHER]) == (84, 5)
    assert storage[HEADER] > 0


def test_what_is_not_a_clip_file_is_a_typed_error(tmp_path):
    (tmp_path / "a.safetensors").write_bytes(b"x" * 100)
    for name in ("a.safetensors", "missing.safetensors"):
        with pytest.raises(ProjectError, match="not a clip file"):
            storage_of(tmp_path / name)
