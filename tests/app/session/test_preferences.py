"""What the user prefers: kept, read again, and never a failure."""

from __future__ import annotations

import json
import logging
from pathlib import Path

import pytest

from app.session.projects.preferences import MAX_USED, Preferences, PreferencesFile


def test_what_was_chosen_is_read_again(tmp_path: Path) -> None:
    file = PreferencesFile(tmp_path / "folder" / "preferences.json")
    assert file.values == Preferences()
    file.values.theme, file.values.cache_mb = "light", 1024
    file.values.keys["time.play"] = ["K", "Ctrl+\u05d0"]
    file.values.layouts["100 % ##\n"] = "[Window]\n"
    file.values.note_used("time.play")
    file.save()
    assert PreferencesFile(file.path).values == file.values


def test_nothing_is_written_while_nothing_was_changed(tmp_path: Path) -> None:
    file = PreferencesFile(tmp_path / "preferences.json")
    file.save()
    assert not file.path.exists()
    file.values.theme = "light"
    file.save()
    file.path.unlink()
    file.save()
    assert not file.path.exists()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("theme", "pink"),
        ("theme", 3),
        ("cache_mb", -1),
        ("cache_mb", 1e9),
        ("keys", [1]),
        ("keys", "x"),
        ("layouts", 7),
        ("used_actions", [{}]),
    ],
)
def test_a_value_that_makes_no_sense_costs_that_value_only(
    tmp_path: Path, name: str, value: object, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "preferences.json"
    good = {"theme": "light", "cache_mb": 256, "used_actions": ["a"]}
    path.write_text(json.dumps(good | {name: value}))
    with caplog.at_level(logging.WARNING):
        values = PreferencesFile(path).values
    assert getattr(values, name) == getattr(Preferences(), name)
    assert [getattr(values, other) for other in good if other != name] == [
        good[other] for other in good if other != name
    ]
    assert name in caplog.text


def test_one_damaged_entry_costs_that_entry_only(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "preferences.json"
    path.write_text(json.dumps({"keys": {"a": ["K"], "b": "K", "c": [1], "d": []}, "layouts": {"x": "text", "y": 3}}))
    values = PreferencesFile(path).values
    assert values.keys == {"a": ["K"], "d": []}
    assert values.layouts == {"x": "text"}
    assert len(caplog.records) == 3


@pytest.mark.parametrize("content", ["", "{", "[]", "\x00\xff", '{"theme": NaN}'])
def test_a_damaged_file_counts_as_empty(tmp_path: Path, content: str) -> None:
    path = tmp_path / "preferences.json"
    path.write_text(content)
    assert PreferencesFile(path).values == Preferences()


def test_a_folder_that_cannot_be_written_is_said_once_and_costs_nothing_else(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "config").write_text("a file where the folder should be")
    file = PreferencesFile(tmp_path / "config" / "preferences.json")
    with caplog.at_level(logging.WARNING):
        for theme in ("light", "system", "dark"):
            file.values.theme = theme
            file.save()
    assert file.failure
    assert sum(record.levelno == logging.WARNING and "saved" in record.message for record in caplog.records) == 1


def test_the_palette_remembers_so_many_and_the_newest_first() -> None:
    values = Preferences()
    for i in range(MAX_USED + 5):
        values.note_used(f"action{i}")
    values.note_used("action20")
    assert values.used_actions[:2] == ["action20", f"action{MAX_USED + 4}"]
    assert len(values.used_actions) == MAX_USED
