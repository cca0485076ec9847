"""project.json: one bad byte costs at most that file, and is never believed; earlier schemas are taken over."""

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.document.project_document import (
    Label,
    Marker,
    ProjectDocument,
    World,
)
from app.document.project_settings import ProjectSettings
from app.document.storing.document_file import BACKUP_FILE, MAX_DOCUMENT_BYTES, read_document, write_document
from app.document.storing.stored_document import plain_document
from app.project.opening.project_access import create_project, open_project
from engine.camera.path_presets import turntable
from engine.capture.exclusions import ExcludedFrames, Exclusions, PaintedMask, Stroke
from engine.editing.actions import Delete, Expose, Transform
from engine.editing.edit import Box, Edit, Picked, PickedRows, Scope, Sphere
from engine.editing.picks import pack_rows
from engine.errors import ProjectError
from engine.gate.regions import parse_region
from engine.storage.json_files import write_checked_json

SETTINGS = ProjectSettings(capture="somewhere", fingerprint="abc", holdout=("1",), overrides={"passes": 6.0})
REGION = parse_region({"treat": "static", "sphere": [[0.0, 1.0, 2.0], 0.5]})
TURN = turntable(np.zeros(3), np.array([0.0, 0.0, 1.0]), 2.0, 0.3, (0, 29), name='<b>100 %s ##1\n"é"</b>')
PICKED = Picked((PickedRows(2, "abc", "residual", pack_rows(np.array([5, 3, 700_000]))),))
EDITS = (
    Edit(1, "gone", Sphere((0.0, 1.0, 2.0), 0.5), Delete(), Scope(5, 15)),
    Edit(3, "brighter", PICKED, Expose(0.5), Scope(is_reference_only=True), is_on=False),
    Edit(2, "", Box((0.0, 0.0, 0.0), (1.0, 2.0, 3.0)), Transform((1.0, 0.0, 0.0)), is_inverted=True),
)
FULL = ProjectDocument(
    SETTINGS,
    (REGION,),
    (TURN,),
    EDITS,
    (Marker(7, "clap"),),
    (Label("camera", "cam00", "door"),),
    Exclusions(
        ("cam03",),
        (ExcludedFrames(None, 3, 4), ExcludedFrames("cam01", 0, 9)),
        (PaintedMask("cam01", 0, 30, (Stroke(((0.5, 0.5), (0.6, 0.5)), 0.02),)),),
    ),
    World((0.0, 0.0, 1.0), 0.5),
)


def edited_by_hand(folder: Path, change: Any) -> None:
    """As who takes out the checksum does."""
    path = folder / "project.json"
    content = json.loads(path.read_text())
    del content["checksum"]
    change(content)
    path.write_text(json.dumps(content))


def test_a_document_comes_back_to_the_last_digit(tmp_path: Path) -> None:
    write_document(tmp_path, FULL)
    read = read_document(tmp_path)
    assert plain_document(read) == plain_document(FULL)
    assert read.edits == EDITS
    before = (tmp_path / "project.json").read_bytes()
    write_document(tmp_path, read)
    assert (tmp_path / "project.json").read_bytes() == before
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"project.json", BACKUP_FILE}, "something half-written was left"


@pytest.mark.parametrize(
    ("entry", "text"),
    [
        *(("scale", text) for text in ("1" + "0" * 400, "9" * 5000, "NaN", "1e999", "true", "[" * 5000 + "]" * 5000)),
        *(("clip_length", text) for text in ("1" + "0" * 30, "2.5", "true", "null", "-1", '"5"')),
        *(("seed", text) for text in (str(2**32), "-1", "1e3")),
        *(("reference_clip", text) for text in (str(10**39), "-1")),
        *(("holdout", text) for text in ('"12"', "[1]", "{}", "null")),
        *(("overrides", text) for text in ("[]", '{"passes": "many"}', '{"passes": [1]}', '{"gate": 3}')),
        *(("overrides", text) for text in ('{"gaussians_per_anchor": 2.5}', '{"independent": 1}')),
        *(("capture", text) for text in ("3", "null", '"a\\u0000b"', '"\\ud800"', "{}")),
        *(("schema", text) for text in ("true", "1.0", '"1"', "null")),
    ],
)
def test_an_odd_value_in_the_project_file_is_refused_with_the_file(tmp_path: Path, entry: str, text: str) -> None:
    write_document(tmp_path, FULL)
    path = tmp_path / "project.json"
    edited_by_hand(tmp_path, lambda content: (content if entry == "schema" else content["settings"]).update({entry: 0}))
    content = json.loads(path.read_text())
    (content if entry == "schema" else content["settings"])[entry] = "HERE"
    path.write_text(json.dumps(content).replace('"HERE"', text))
    with pytest.raises(ProjectError) as caught:
        read_document(tmp_path)
    assert caught.value.path == path
    assert len(caught.value.message) < 300


def test_odd_files_in_place_of_the_project_file_are_refused_at_once(tmp_path: Path) -> None:
    path = tmp_path / "project.json"
    os.mkfifo(path)
    with pytest.raises(ProjectError, match="a pipe or a device"):
        open_project(tmp_path)
    path.unlink()
    path.symlink_to("/dev/zero")
    with pytest.raises(ProjectError, match="a pipe or a device"):
        open_project(tmp_path)
    path.unlink()
    path.write_bytes(b" ")
    os.truncate(path, MAX_DOCUMENT_BYTES + 1)
    with pytest.raises(ProjectError, match=f"at most {MAX_DOCUMENT_BYTES} are read"):
        open_project(tmp_path)
    path.write_bytes(b'{"schema": 1, "capture": "\xff"}')
    with pytest.raises(ProjectError, match="not UTF-8"):
        open_project(tmp_path)


def test_a_changed_digit_in_the_project_file_is_seen_and_a_hand_edit_can_be_accepted(tmp_path: Path) -> None:
    write_document(tmp_path, FULL)
    path = tmp_path / "project.json"
    text = path.read_text()
    assert '"clip_length": 10' in text
    path.write_text(text.replace('"clip_length": 10', '"clip_length": 11'))
    with pytest.raises(ProjectError, match='take out its entry "checksum"'):
        read_document(tmp_path)
    edited_by_hand(tmp_path, lambda content: None)
    assert read_document(tmp_path).settings.clip_length == 11


@pytest.mark.parametrize("n_bytes", [0, 1, 100, -2])
def test_a_file_that_was_cut_off_is_damaged(tmp_path: Path, n_bytes: int) -> None:
    write_document(tmp_path, FULL)
    path = tmp_path / "project.json"
    path.write_bytes(path.read_bytes()[:n_bytes])
    with pytest.raises(ProjectError, match="cannot be read"):
        read_document(tmp_path)


ODD = [
    (("schema",), 3, "schema 3"),
    (("colour",), 1, "colour"),
    (("edits",), {}, "not a list"),
    (("edits", 0, "edit_id"), 3, "same number"),
    (("edits", 0, "action", "type"), "explode", "explode"),
    (("edits", 0, "target", "radius"), -1.0, "radius"),
    (("edits", 0, "target", "radius"), "1", "not a number"),
    (("edits", 0, "scope", "stop"), 5, "holds no frame"),
    (("edits", 0, "speed"), 5, "speed"),
    (("edits", 1, "target", "sets", 0, "rows"), "!!", "rows"),
    (("edits", 1, "target", "sets", 0, "rows"), "AAAA", "damaged"),
    (("edits", 1, "action", "stops"), 17.0, "stops"),
    (("edits", 2, "action", "quat"), [0, 0, 0, 0], "not a rotation"),
    (("markers", 0, "frame_index"), -1, "frame_index"),
    (("labels", 0, "kind"), "lamp", "kind"),
    (("exclusions", "frames", 0, "stop"), 3, "empty range"),
    (("exclusions", "masks", 0, "strokes", 0, "points"), [], "points"),
    (("world", "up"), [0, 0, 0], "unit length"),
    (("world", "meters_per_unit"), 0, "out of range"),
    (("regions", 0), 3, "region"),
    (("regions", 0), {"treat": "static", "sphere": {}}, "is not a region"),
    (("camera_paths",), {}, "not a list"),
    (("camera_paths", 0, "name"), "", "name"),
    (("camera_paths", 0, "name"), "x" * 500, "name"),
    (("camera_paths", 0, "speed"), 3, "speed"),
    (("camera_paths", 0, "is_closed"), 1, "not true or false"),
    (("camera_paths", 0, "keys", 0, "frame"), "0", "not a number"),
    (("camera_paths", 0, "keys", 0, "frame"), 1e12, "the frame of a key"),
    (("camera_paths", 0, "keys", 0, "frame"), 29.0, "not in order"),
    (("camera_paths", 0, "keys", 0, "fov_y_rad"), -0.1, "field of view"),
    (("camera_paths", 0, "keys", 0, "world_to_camera", 0, 0), 2.0, "rotation"),
    (("camera_paths", 0, "keys", 0, "world_to_camera", 0), [1, 0, 0], "world_to_camera"),
]


@pytest.mark.parametrize(("place", "value", "expected"), ODD)
def test_an_entry_that_makes_no_sense_is_named(
    tmp_path: Path, place: tuple[Any, ...], value: Any, expected: str
) -> None:
    write_document(tmp_path, FULL)

    def change(content: Any) -> None:
        for step in place[:-1]:
            content = content[step]
        content[place[-1]] = value

    edited_by_hand(tmp_path, change)
    with pytest.raises(ProjectError) as raised:
        read_document(tmp_path)
    assert expected in str(raised.value)
    assert raised.value.path == tmp_path / "project.json"
    assert raised.value.hint


@pytest.mark.parametrize(
    ("paths", "expected"),
    [((TURN, TURN), "two camera paths"), ((replace(TURN, name="\ud800"),), "not Unicode")],
)
def test_what_could_not_be_read_again_is_not_written(tmp_path: Path, paths: Any, expected: str) -> None:
    write_document(tmp_path, FULL)
    with pytest.raises(ProjectError, match=expected):
        write_document(tmp_path, replace(FULL, camera_paths=paths))
    assert plain_document(read_document(tmp_path)) == plain_document(FULL)


def test_a_change_is_flushed_to_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    flushed: list[int] = []
    monkeypatch.setattr("engine.storage.files.os.fsync", flushed.append)
    project = create_project(tmp_path / "p", SETTINGS)
    assert len(flushed) == 4  # document and journal before their rename, the folder after it
    project.change(FULL, "mark a region")
    assert len(flushed) > 4
    project.close()


# ---------------------------------------------------------------- schema 1

OLD = {"capture": "somewhere", "fingerprint": "abc", "scale": 1, "clip_length": 10, "holdout": ["1"], "seed": 0} | {
    "overrides": {"passes": 6.0},
    "reference_clip": 0,
    "schema": 1,
}


def write_schema_1(folder: Path) -> None:
    plain = plain_document(FULL)
    (folder / "project.json").write_text(json.dumps(OLD, indent=2))
    write_checked_json(folder / "gate.json", {"regions": plain["regions"]})
    write_checked_json(folder / "camera_paths.json", {"schema": 1, "paths": plain["camera_paths"]})


def test_a_project_of_the_version_before_is_read_and_taken_over_with_its_first_change(tmp_path: Path) -> None:
    write_schema_1(tmp_path)
    expected = ProjectDocument(SETTINGS, (REGION,), (TURN,))
    assert plain_document(read_document(tmp_path)) == plain_document(expected)
    assert (tmp_path / "gate.json").is_file()
    project = open_project(tmp_path)
    project.change(replace(project.document, markers=(Marker(3, "a"),)), "add a marker")
    project.close()
    assert not (tmp_path / "gate.json").exists()
    assert not (tmp_path / "camera_paths.json").exists()
    again = open_project(tmp_path, is_writable=False).document
    assert plain_document(again) == plain_document(replace(expected, markers=(Marker(3, "a"),)))


@pytest.mark.parametrize("name", ["gate.json", "camera_paths.json"])
@pytest.mark.parametrize("bad", ["[" * 10_000, "[]", '{"regions": 3}', '{"schema": 2, "paths": []}', "", "\0"])
def test_a_damaged_file_beside_a_project_of_the_version_before_is_refused_with_its_name(
    tmp_path: Path, name: str, bad: str
) -> None:
    write_schema_1(tmp_path)
    (tmp_path / name).write_text(bad)
    with pytest.raises(ProjectError) as raised:
        read_document(tmp_path)
    assert raised.value.path == tmp_path / name
