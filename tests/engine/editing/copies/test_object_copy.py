"""ObjectCopy: its time against a slow truth that walks frame by frame, and what it refuses."""

from __future__ import annotations

from fractions import Fraction

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engine.editing.actions import Hide, Transform
from engine.editing.copies.object_copy import (
    ObjectCopy,
    OnObject,
    OnPath,
    hiding_edits,
    nearest_frame,
    span_of,
)
from engine.editing.edit import EVERYWHERE, Edit, ObjectTarget, PickedRows, Scope
from engine.editing.effects import EditStack, Effects
from engine.editing.picks import pack_rows
from engine.editing.scene_object import ObjectInClip, SceneObject

QUARTERS = st.integers(-200, 200).map(lambda n: n / 4)
SETS = (PickedRows(0, "own", "moving", pack_rows(__import__("numpy").arange(3))),)


def slow_truth(copy: ObjectCopy, frame: float, span: tuple[int, int]) -> float | None:
    """The same by counting: exact numbers, and whole rounds one by one."""
    anchor, first, stop = Fraction(copy.anchor_frame), span[0], span[1]
    at = anchor + Fraction(copy.speed) * (Fraction(frame) - anchor) - Fraction(copy.shift_frames)
    if copy.outside == "loop":
        while at < first:
            at += stop - first
        while at >= stop:
            at -= stop - first
    if copy.outside == "gone" and (at < first or at >= stop):
        return None
    return float(max(min(at, Fraction(stop - 1)), Fraction(first)))


@given(
    frame=QUARTERS,
    shift=QUARTERS,
    speed=st.sampled_from([-2.0, -1.0, -0.25, 0.0, 0.5, 1.0, 2.0, 3.0]),
    anchor=QUARTERS,
    outside=st.sampled_from(["hold", "loop", "gone"]),
    first=st.integers(0, 20),
    n=st.integers(1, 12),
)
def test_the_time_of_a_copy(
    frame: float, shift: float, speed: float, anchor: float, outside: str, first: int, n: int
) -> None:
    copy = ObjectCopy(1, "a", 1, shift_frames=shift, speed=speed, anchor_frame=anchor, outside=outside)  # pyright: ignore[reportArgumentType]
    span = (first, first + n)
    found = copy.source_frame(frame, span)
    assert found == slow_truth(copy, frame, span)
    assert found is None or (first <= found <= first + n - 1 and first <= nearest_frame(found) < first + n)


def test_a_later_copy_does_what_the_object_did():
    copy = ObjectCopy(1, "a", 1, shift_frames=5.0)
    assert copy.source_frame(12.0, (0, 40)) == 7.0
    assert copy.source_frame(2.0, (0, 40)) == 0.0  # it waits for the first frame
    faster = ObjectCopy(1, "a", 1, speed=2.0, anchor_frame=10.0)
    assert [faster.source_frame(frame, (0, 40)) for frame in (10.0, 11.0, 12.5)] == [10.0, 12.0, 15.0]


@pytest.mark.parametrize(
    "values",
    [
        {"shift_frames": float("nan")},
        {"shift_frames": 1e10},
        {"speed": float("inf")},
        {"speed": 101.0},
        {"anchor_frame": float("nan")},
        {"first": 4, "stop": 4},
    ],
)
def test_what_a_copy_refuses(values: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="copy"):
        ObjectCopy(1, "a", 1, **values)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("carried_by", [None, OnPath("orbit"), OnObject(3)])
def test_a_copy_travels_as_json(carried_by: OnPath | OnObject | None) -> None:
    copy = ObjectCopy(1, "a", 2, Transform((1.0, 0.0, 0.0)), 2.5, 0.5, 3.0, "loop", True, carried_by, 1, 9, "g", False)
    assert msgspec.json.decode(msgspec.json.encode(copy), type=ObjectCopy) == copy


@pytest.mark.parametrize(
    "entry", ['"speed": "fast"', '"outside": "away"', '"carried_by": {"type": "wind"}', '"name": ""', '"more": 1']
)
def test_entries_that_are_not_of_a_copy_are_refused(entry: str) -> None:
    with pytest.raises(msgspec.ValidationError):
        msgspec.json.decode('{"copy_id": 1, "name": "a", "object_id": 1, ' + entry + "}", type=ObjectCopy)


def test_when_an_object_exists():
    there = ObjectInClip(10, 20, SETS)
    assert span_of(SceneObject(1, "a", clips=(there,))) == (10, 20)
    assert span_of(SceneObject(1, "a", clips=(ObjectInClip(0, 10), there), first=12, stop=18)) == (12, 18)
    seen = ObjectInClip(20, 30, SETS, seen=((20, 22), (24, 26)))
    assert span_of(SceneObject(1, "a", clips=(there, seen))) == (10, 26)
    assert span_of(SceneObject(1, "a", clips=(ObjectInClip(0, 10),))) is None
    assert span_of(SceneObject(1, "a", clips=(there,), first=25)) is None


def test_an_object_whose_place_is_taken_is_hidden_as_long():
    one = SceneObject(4, "a", clips=(ObjectInClip(0, 10, SETS), ObjectInClip(10, 20)))
    copies = (ObjectCopy(1, "b", 4, is_in_place=True, first=3, stop=6), ObjectCopy(2, "c", 4))
    assert list(hiding_edits(copies)) == [Edit(1, "b", ObjectTarget(4), Hide(), Scope(3, 6))]
    stack = EditStack((), (one,), copies)
    hidden = Effects.of((Edit(0, "", ObjectTarget(4), Hide(), EVERYWHERE),), 3, (one,))
    assert [bool(stack.at(frame)) for frame in (2.0, 3.0, 5.9, 6.0)] == [False, True, True, False]
    assert stack.at(3.0) == hidden
