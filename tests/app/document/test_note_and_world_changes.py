"""Markers, labels, up and scale of a document."""

from __future__ import annotations

import math

import pytest

from app.document.changes import note_changes as notes
from app.document.changes import world_changes as world
from app.document.project_document import Label, Marker, ProjectDocument
from app.document.project_settings import ProjectSettings
from app.document.storing.stored_document import document_of, plain_document
from engine.errors import ProjectError

EMPTY = ProjectDocument(ProjectSettings("capture", "fingerprint"))


def test_markers_stay_in_the_order_of_their_frames() -> None:
    document = notes.put_marker(notes.put_marker(EMPTY, 9, "late"), 3)
    document = notes.put_marker(document, 3, "50 % ## early")
    assert document.markers == (Marker(3, "50 % ## early"), Marker(9, "late"))
    moved = notes.move_marker(document, 3, 12)
    assert moved.markers == (Marker(9, "late"), Marker(12, "50 % ## early"))
    assert notes.move_marker(document, 3, 3) is document
    assert notes.remove_marker(moved, 9).markers == (Marker(12, "50 % ## early"),)
    assert document_of(plain_document(document)) == document


def test_markers_that_cannot_be_are_refused() -> None:
    document = notes.put_marker(notes.put_marker(EMPTY, 3), 9)
    for act in (
        lambda: notes.put_marker(document, -1),
        lambda: notes.put_marker(document, 1, "x" * 201),
        lambda: notes.put_marker(document, 1, "\udfff"),
        lambda: notes.remove_marker(document, 4),
        lambda: notes.move_marker(document, 3, 9),
        lambda: notes.move_marker(document, 4, 5),
        lambda: notes.move_marker(document, 3, -1),
    ):
        with pytest.raises(ProjectError):
            act()


def test_there_is_room_for_so_many_markers_and_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(notes, "MAX_MARKERS", 2)
    document = notes.put_marker(notes.put_marker(EMPTY, 3), 9)
    assert notes.put_marker(document, 9, "again").markers[1].text == "again"
    with pytest.raises(ProjectError, match="2 markers"):
        notes.put_marker(document, 10)


def test_labels_name_clips_and_cameras() -> None:
    document = notes.set_label(notes.set_label(EMPTY, "clip", "10", " jump "), "camera", "cam01", "door")
    assert document.labels == (Label("camera", "cam01", "door"), Label("clip", "10", "jump"))
    assert document_of(plain_document(document)) == document
    assert notes.set_label(document, "clip", "10", " ").labels == document.labels[:1]
    with pytest.raises(ProjectError, match="characters"):
        notes.set_label(EMPTY, "clip", "10", "x" * 201)


def test_up_is_kept_at_unit_length() -> None:
    document = world.set_up(EMPTY, (0.0, -3.0, 4.0))
    assert document.world.up == pytest.approx((0.0, -0.6, 0.8))
    assert document_of(plain_document(document)) == document
    assert world.set_up(document, None) == EMPTY
    for direction in ((0.0, 0.0, 0.0), (math.nan, 0.0, 1.0), (math.inf, 0.0, 0.0), (1.0, 2.0)):
        with pytest.raises(ProjectError, match="not a direction"):
            world.set_up(EMPTY, direction)


def test_the_scale_has_a_range() -> None:
    document = world.set_scale(world.set_up(EMPTY, (0.0, 0.0, 2.0)), 0.25)
    assert (document.world.up, document.world.meters_per_unit) == ((0.0, 0.0, 1.0), 0.25)
    assert world.set_scale(document, None).world.meters_per_unit is None
    for scale in (0.0, -1.0, math.nan, math.inf, 1e12):
        with pytest.raises(ProjectError, match="scale"):
            world.set_scale(EMPTY, scale)


def test_three_points_of_the_ground_say_what_is_up() -> None:
    points = ((0.0, 5.0, 0.0), (2.0, 5.0, 0.0), (0.0, 5.0, 3.0))
    assert world.up_of_ground(points, (0.0, 1.0, 0.0)) == pytest.approx((0.0, -1.0, 0.0))
    assert world.up_of_ground(points[::-1], (0.0, 9.0, 0.0)) == pytest.approx((0.0, 1.0, 0.0))
    with pytest.raises(ProjectError, match="on a line"):
        world.up_of_ground(((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (2.0, 2.0, 2.0)), (0.0, 1.0, 0.0))
    with pytest.raises(ProjectError, match="on a line"):
        world.up_of_ground((points[0], points[0], points[1]), (0.0, 1.0, 0.0))
    with pytest.raises(ProjectError, match="ground"):
        world.up_of_ground(points, (7.0, 5.0, 7.0))


def test_a_known_length_says_the_scale() -> None:
    assert world.scale_of_length((0.0, 0.0, 0.0), (0.0, 3.0, 4.0), 2.0) == pytest.approx(0.4)
    with pytest.raises(ProjectError, match="the same"):
        world.scale_of_length((1.0, 1.0, 1.0), (1.0, 1.0, 1.0), 2.0)
    for length in (0.0, -1.0, math.nan):
        with pytest.raises(ProjectError, match="positive"):
            world.scale_of_length((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), length)
