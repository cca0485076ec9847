"""Patches: exactly what differs, to the last digit and sign, and as small as the step was."""

import json
import random
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from msgspec import structs

from app.document.storing.document_patch import document_difference, document_with
from app.document.storing.plain_patch import PatchError, difference, patched
from engine.editing.edit import Edit
from engine.errors import ProjectError
from tests.app.document.documents import EMPTY, as_bytes, picked_edit, random_events

plain = st.recursive(
    st.none() | st.booleans() | st.integers(-3, 3) | st.sampled_from((0.0, -0.0, 1.0, 2.5)) | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.sampled_from("abcd"), inner, max_size=4),
    max_leaves=12,
)


def exact(value: Any) -> str:
    return json.dumps(value, sort_keys=True)


@settings(max_examples=150)
@given(plain, plain)
@example([{"a": 0.0}], [{"a": -0.0}])
@example({"a": 1}, {"a": 1.0})
def test_a_patch_makes_one_value_of_another_to_the_last_sign(before: Any, after: Any) -> None:
    kept = exact(before)
    patch = difference(before, after)
    assert (patch is None) == (exact(before) == exact(after))
    if patch is not None:
        assert exact(patched(before, json.loads(json.dumps(patch)))) == exact(after)
    assert exact(before) == kept


@pytest.mark.parametrize(
    "patch",
    [
        *(None, [], {}, {"in": 3}, {"in": {}, "out": ["b"]}, {"in": {"b": {"in": {}}}}, {"is": 1, "in": {}}),
        *({"items": 3}, {"in": {"a": {"items": [[0, 4]]}}}, {"in": {"a": {"items": [[1, 1]]}}}),
        *({"in": {"a": {"items": [{"of": 3, "is": 1}]}}}, {"in": {"a": {"items": [{"of": True, "is": 1}]}}}),
        *({"in": {"a": {"items": [[0.0, 1]]}}}, {"in": {"a": {"items": ["x"]}}}, {"in": {"a": {"in": {}}}}),
    ],
)
def test_a_patch_for_something_else_is_refused(patch: Any) -> None:
    with pytest.raises(PatchError):
        patched({"a": [1, 2, 3]}, patch)


@pytest.mark.slow
def test_patches_between_documents_give_them_back_byte_for_byte_both_ways() -> None:
    before = EMPTY
    for _, history in random_events(random.Random(5), 300):
        after = history.present
        for old, new in ((before, after), (after, before)):
            patch = json.loads(json.dumps(document_difference(old, new)))
            assert as_bytes(document_with(old, patch)) == as_bytes(new)
        before = after


def test_switching_one_edit_off_does_not_write_what_it_picked() -> None:
    edits = tuple(picked_edit(i, 5000, random.Random(i)) for i in range(20))
    before = replace(EMPTY, edits=edits)
    after = replace(before, edits=(*edits[:7], structs.replace(edits[7], is_on=False), *edits[8:]))
    patch = document_difference(before, after)
    assert patch == {"edits": {"items": [[0, 7], {"of": 7, "in": {"is_on": {"is": False}}}, [8, 20]]}}
    read = document_with(before, patch)
    assert all(read.edits[i] is edits[i] for i in range(20) if i != 7)


def test_edits_that_change_places_are_not_written_again() -> None:
    edits = tuple(picked_edit(i, 5000, random.Random(i)) for i in range(4))
    before = replace(EMPTY, edits=edits)
    patch = document_difference(before, replace(before, edits=(edits[3], *edits[:3])))
    assert patch == {"edits": {"items": [[3, 4], [0, 3]]}}


def test_what_could_not_be_read_again_is_not_written() -> None:
    edit = picked_edit(1, 3, random.Random(1))
    for edits in (
        (edit, edit),
        (Edit(-1, "", edit.target, edit.action),),
        (Edit(1, "x" * 300, edit.target, edit.action),),
    ):
        with pytest.raises(ProjectError):
            document_difference(EMPTY, replace(EMPTY, edits=edits))


@pytest.mark.parametrize(
    "patch",
    [
        *(
            [],
            {"edit": {"items": []}},
            {"edits": {"is": []}},
            {"edits": {"items": [{"is": {}}]}},
            {"world": {"items": []}},
        ),
        *({"world": {"in": {"up": {"is": [1.0, 2.0]}}}}, {"markers": {"items": [[0, 1]]}}, {"settings": {"is": 3}}),
    ],
)
def test_a_patch_for_another_document_is_refused(patch: Any) -> None:
    with pytest.raises(PatchError):
        document_with(EMPTY, patch)
