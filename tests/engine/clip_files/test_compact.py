"""The compact form of a finished clip: sizes, stated errors, damage, what other clips are tied to."""

from __future__ import annotations

import json

import numpy as np
import pytest
import torch
from msgspec.structs import replace
from safetensors import safe_open
from safetensors.numpy import save_file

from engine.backends.table import backend_called
from engine.clip_files.clip_state import ClipState, read_clip_state, write_clip_state
from engine.clip_files.compact import compact_clip, write_compact_clip
from engine.errors import NonFiniteLoss, ProjectError
from engine.model.anchors import AnchorSet
from engine.model.reading import load_clip_model
from tests.clip_headers import with_header
from tests.engine.model.test_clip_model import N_FRAMES, make_anchors, make_field, make_reference, state_of


@pytest.fixture
def reference() -> ClipState:
    state = state_of(make_reference(), role="reference")
    return ClipState(state.arrays | {"gains": np.ones((3, 3), np.float32)}, state.header)


def make_source(reference: ClipState, n: int = 300) -> ClipState:
    """A source clip with residual anchors on a lattice and a field that has learned."""
    rng = np.random.default_rng(4)
    presence = torch.from_numpy(rng.random((n, N_FRAMES)) < 0.3)
    anchors = make_anchors(n, seed=5, presence=presence)
    points = torch.from_numpy((0.01 + 0.02 * rng.integers(0, 48, (n, 3))).astype(np.float32))
    arrays = {name: getattr(anchors, name).detach().numpy() for name in dict(anchors.named_parameters())}
    arrays |= {"positions": points.numpy(), "color_logits": anchors.color_logits.numpy(), "presence": presence.numpy()}
    field = make_field(6)
    with torch.no_grad():
        for table in field.tables:
            table.normal_(generator=torch.Generator().manual_seed(7))
    assert isinstance(anchors, AnchorSet)
    found = {f"sets.residual.{name}": array for name, array in arrays.items()}
    found |= {f"field.{name}": value.numpy().copy() for name, value in field.state_dict().items()}
    found["inherited.moving.presence"] = np.ones((10, N_FRAMES), bool)
    header = replace(
        reference.header,
        role="source",
        clip_index=1,
        reference_fingerprint=reference.header.fingerprint,
        field=field.shape,
        moving_spacing=0.02,
    )
    return ClipState(found, header)


def test_what_is_read_is_what_was_promised(reference, tmp_path):
    for name, state in (("0000", reference), ("0001", make_source(reference))):
        clip = compact_clip(state)
        write_compact_clip(tmp_path / f"{name}.safetensors", clip)
        found = read_clip_state(tmp_path / f"{name}.safetensors")
        assert found.header == clip.state.header
        assert found.fingerprint == clip.state.fingerprint == found.header.fingerprint
        for key, array in state.arrays.items():
            assert (found.arrays[key].shape, found.arrays[key].dtype) == (array.shape, array.dtype)
            error = np.abs(found.arrays[key].astype(np.float64) - array).max(initial=0.0)
            assert error <= clip.coded[key].spec["max_error"]


def test_a_source_clip_takes_a_fraction_and_looks_the_same(reference):
    stored = compact_clip(reference).state
    source = make_source(stored)
    model = load_clip_model(source, stored, backend=backend_called("cpu"))
    clip = compact_clip(source, model.entries_in_use())
    assert clip.n_bytes < 0.2 * sum(array.nbytes for array in source.arrays.values())
    before, after = model.decode(0.5), load_clip_model(clip.state, stored, backend=backend_called("cpu")).decode(0.5)
    assert torch.allclose(before.means, after.means, atol=0.02)  # anchors are 0.1 apart
    assert torch.allclose(before.colors, after.colors, atol=0.1)


def test_entries_nobody_reads_are_left_out_and_change_nothing(reference):
    source = make_source(reference, n=3)
    model = load_clip_model(source, reference, backend=backend_called("cpu"))
    used = model.entries_in_use()
    assert 0 < sum(table.sum() for table in used) < 0.3 * sum(table.size for table in used)
    clip, whole = compact_clip(source, used), compact_clip(source)
    assert clip.n_bytes < 0.5 * whole.n_bytes
    for knot, table in enumerate(used):
        assert not clip.state.arrays[f"field.tables.{knot}"][~table].any()
    emptied = {
        f"field.tables.{k}": np.where(table[..., None], source.arrays[f"field.tables.{k}"], np.float32(0))
        for k, table in enumerate(used)
    }
    for frame in range(N_FRAMES):
        before = model.decode(frame / N_FRAMES)
        after = load_clip_model(
            ClipState(source.arrays | emptied, source.header), reference, backend=backend_called("cpu")
        ).decode(frame / N_FRAMES)
        assert torch.equal(before.means, after.means)


def test_a_source_clip_knows_the_stored_reference_and_no_other(reference, tmp_path):
    clip = compact_clip(reference)
    write_compact_clip(tmp_path / "0000.safetensors", clip)
    stored = read_clip_state(tmp_path / "0000.safetensors")
    load_clip_model(make_source(stored), stored, backend=backend_called("cpu"))
    assert stored.header.fingerprint != reference.header.fingerprint
    with pytest.raises(ProjectError, match="was trained on reference"):
        load_clip_model(make_source(reference), stored, backend=backend_called("cpu"))


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("name", ["field.tables.1", "sets.moving.features", "gains"])
def test_numbers_that_are_none_are_refused_by_name(reference, name, bad):
    reference.arrays[name] = reference.arrays[name].copy()
    reference.arrays[name].reshape(-1)[1] = bad
    with pytest.raises(NonFiniteLoss, match=f"1 of .* in {name}"):
        compact_clip(reference)


def test_values_beyond_half_precision_and_positions_in_a_wide_world_stay_exact(reference):
    reference.arrays["decoder.first.color"] = np.full_like(reference.arrays["decoder.first.color"], 1e6)
    far = reference.arrays["sets.static.positions"] + np.array([0, 0, 1e4], np.float32) * np.arange(20)[:, None]
    reference.arrays["sets.static.positions"] = far.astype(np.float32)
    clip = compact_clip(reference)
    for name in ("decoder.first.color", "sets.static.positions"):
        assert np.array_equal(clip.state.arrays[name], reference.arrays[name])


def test_positions_stay_exact_where_the_field_would_be_read_elsewhere(reference):
    source = make_source(reference)
    name = "sets.residual.positions"
    arrays = source.arrays | {name: source.arrays[name] + np.float32(1e-3) * np.arange(900).reshape(300, 3)}
    arrays[name] = arrays[name].astype(np.float32)  # learned: on no lattice
    field = source.header.field
    assert field is not None
    coarse = replace(source.header, field=replace(field, cells=(4,) * len(field.cells)))
    fine = replace(source.header, field=replace(field, cells=(4,) * (len(field.cells) - 1) + (1 << 19,)))
    rounded, kept = (compact_clip(ClipState(arrays, header)).state.arrays[name] for header in (coarse, fine))
    assert not np.array_equal(rounded, arrays[name])
    assert np.array_equal(kept, arrays[name])


def test_files_of_the_first_schema_are_read(reference, tmp_path):
    write_clip_state(tmp_path / "old.safetensors", with_header(reference, schema=1))
    found = read_clip_state(tmp_path / "old.safetensors")
    assert found.fingerprint == reference.fingerprint
    load_clip_model(found, None, backend=backend_called("cpu"))


def test_truncated_files_are_named_as_damaged(reference, tmp_path):
    path = tmp_path / "0000.safetensors"
    write_compact_clip(path, compact_clip(reference))
    content = path.read_bytes()
    for n in (0, 7, len(content) // 3, len(content) - 1):
        path.write_bytes(content[:n])
        with pytest.raises(ProjectError, match="damaged"):
            read_clip_state(path)


@pytest.mark.parametrize("damage", ["bytes", "missing", "extra", "no list", "no json"])
def test_damaged_arrays_and_descriptions_are_named_as_damaged(reference, tmp_path, damage):
    path = tmp_path / "0000.safetensors"
    write_compact_clip(path, compact_clip(reference))
    with safe_open(path, framework="numpy") as file:
        metadata = dict(file.metadata())
        arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - not a mapping
    del metadata["checksum"]  # as files of earlier versions, which rest on the checksum in each description
    specs = json.loads(metadata["coding"])
    if damage == "bytes":
        arrays["sets.static.features"][20] ^= 0xFF
    elif damage == "missing":
        del specs["gains"]
    elif damage == "extra":
        specs["more"] = specs["gains"]
    metadata["coding"] = {"no list": "[1]", "no json": "{"}.get(damage, json.dumps(specs))
    save_file(arrays, path, metadata=metadata)
    with pytest.raises(ProjectError, match="damaged") as caught:
        read_clip_state(path)
    assert caught.value.path == path
    if damage == "bytes":
        assert "sets.static.features" in str(caught.value)
