"""Keys that the user gives to actions: conflicts, ways back, damaged entries."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import pytest

from ui.panels.actions.key import parse_key
from ui.panels.actions.key_map import KeyMap
from ui.panels.actions.table import ACTIONS


@dataclass(frozen=True)
class Row:
    id: str
    keys: tuple[str, ...] = ()


PLAY, TRAIN, UNDO, QUIET = Row("play", ("Space",)), Row("train", ("T",)), Row("undo", ("Ctrl+Z", "U")), Row("quiet")
ROWS = (PLAY, TRAIN, UNDO, QUIET)


def test_actions_have_their_own_keys_until_others_are_chosen() -> None:
    keys = KeyMap()
    assert keys.labels(UNDO) == ("Ctrl+Z", "U")
    assert (keys.label(QUIET), keys.labels(QUIET), keys.keys(QUIET)) == ("", (), ())
    keys.assign(UNDO, "Ctrl+Shift+U", ROWS)
    assert keys.labels(UNDO) == ("Ctrl+Shift+U",)
    assert [key.chord for key in keys.keys(UNDO)] == [parse_key("Ctrl+Shift+U").chord]
    assert keys.chosen == {"undo": ["Ctrl+Shift+U"]}


def test_a_key_taken_from_another_action_runs_one_action_only() -> None:
    keys = KeyMap()
    assert [row.id for row in keys.owners("U", ROWS)] == ["undo"]
    keys.assign(PLAY, "U", ROWS)
    assert keys.labels(UNDO) == ("Ctrl+Z",), "it keeps its other key"
    assert [row.id for row in keys.owners("U", ROWS)] == ["play"]
    assert keys.owners("Space", ROWS) == []
    keys.reset(UNDO, ROWS)
    assert (keys.labels(UNDO), keys.labels(PLAY)) == (("Ctrl+Z", "U"), ()), "going back takes the key back, too"
    keys.reset_all()
    assert [keys.labels(row) for row in ROWS] == [row.keys for row in ROWS]


def test_going_back_by_hand_counts_as_never_changed() -> None:
    keys = KeyMap()
    keys.assign(TRAIN, "X", ROWS)
    assert keys.is_changed(TRAIN)
    keys.assign(TRAIN, "T", ROWS)
    assert not keys.is_changed(TRAIN)
    keys.clear(TRAIN)
    assert (keys.labels(TRAIN), keys.is_changed(TRAIN)) == ((), True)


def test_keys_that_are_pressed_with_and_without_shift_collide_with_both() -> None:
    assert parse_key("+").collides(parse_key("Shift++"))
    assert parse_key("Ctrl+-").collides(parse_key("Ctrl+-"))
    assert not parse_key("Ctrl+-").collides(parse_key("-"))
    assert not parse_key("Shift+Left").collides(parse_key("Left"))


def test_what_makes_no_sense_is_ignored_with_a_line_in_the_log(caplog: pytest.LogCaptureFixture) -> None:
    keys = KeyMap({"play": ["Hyper+X"], "gone\n": ["A"], "train": ["Nope", "Y"], "undo": []})
    with caplog.at_level(logging.WARNING):
        keys.drop_unknown(ROWS)
    assert keys.chosen == {"train": ["Y"], "undo": []}
    assert keys.labels(PLAY) == ("Space",)
    assert len(caplog.records) == 3
    assert all("\n" not in record.getMessage() for record in caplog.records)
    with pytest.raises(ValueError, match="does not name a key"):
        keys.assign(PLAY, "Hyper+X", ROWS)


def test_no_two_actions_share_a_key() -> None:
    keys = KeyMap()
    for action in ACTIONS:
        for label in keys.labels(action):
            assert keys.owners(label, ACTIONS) == [action], label
