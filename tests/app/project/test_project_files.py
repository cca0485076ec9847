"""JSON files of a project and of the user: one bad byte costs at most that file or row, and is never believed."""

import json
import os
from pathlib import Path

import pytest
from app.project.project_files import (
    ProjectSettings,
    read_metrics,
    read_regions,
    read_settings,
    write_regions,
    write_settings,
)

from app.project.project import create_project, open_project
from app.project.recents import RecentProject
from app.session.settings import Settings
from engine.errors import ProjectError
from engine.gate.regions import parse_region
from engine.storage.json_files import checked_line

SETTINGS = ProjectSettings(capture="somewhere", fingerprint="abc", holdout=("1",), overrides={"passes": 6.0})
REGION = parse_region({"treat": "static", "sphere": [[0.0, 1.0, 2.0], 0.5]})


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
    write_settings(tmp_path, SETTINGS)
    path = tmp_path / "project.json"
    content = json.loads(path.read_text())
    del content["checksum"]
    path.write_text(json.dumps(content | {entry: "HERE"}).replace('"HERE"', text))
    with pytest.raises(ProjectError) as caught:
        read_settings(tmp_path)
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
    path.write_bytes(b" " * (5 << 20))
    with pytest.raises(ProjectError, match="at most 4194304 are read"):
        open_project(tmp_path)
    path.write_bytes(b'{"schema": 1, "capture": "\xff"}')
    with pytest.raises(ProjectError, match="not UTF-8"):
        open_project(tmp_path)


def test_a_changed_digit_in_the_project_file_is_seen_and_a_hand_edit_can_be_accepted(tmp_path: Path) -> None:
    write_settings(tmp_path, SETTINGS)
    path = tmp_path / "project.json"
    text = path.read_text()
    path.write_text(text.replace('"clip_length": 10', '"clip_length": 11'))
    with pytest.raises(ProjectError, match='take out its entry "checksum"'):
        read_settings(tmp_path)
    content = json.loads(path.read_text())
    del content["checksum"]
    path.write_text(json.dumps(content))
    assert read_settings(tmp_path).clip_length == 11


def test_a_project_file_of_the_version_before_is_read(tmp_path: Path) -> None:
    content = {"capture": "somewhere", "fingerprint": "abc", "scale": 1, "clip_length": 10, "holdout": ["1"], "seed": 0}
    content |= {"overrides": {"passes": 6.0}, "reference_clip": 0, "schema": 1}
    (tmp_path / "project.json").write_text(json.dumps(content, indent=2))
    assert read_settings(tmp_path) == SETTINGS


def test_regions_come_back_and_damage_to_them_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "gate.json"
    assert read_regions(path) == ()
    write_regions(path, [REGION])
    assert read_regions(path) == (REGION,)
    good = path.read_text()
    for bad in (
        good.replace("0.5", "0.6"),
        good.replace('"regions"', '"region"'),
        "[" * 10_000,
        "[]",
        '{"regions": 3}',
    ):
        path.write_text(bad)
        with pytest.raises(ProjectError) as caught:
            read_regions(path)
        assert caught.value.path == path


@pytest.mark.parametrize("region", ["3", '{"treat": "static", "sphere": {}}', '{"treat": [], "box": []}'])
def test_what_is_not_a_region_is_refused_with_the_file(tmp_path: Path, region: str) -> None:
    path = tmp_path / "gate.json"
    path.write_text(f'{{"regions": [{region}]}}')
    with pytest.raises(ProjectError, match="is not a region") as caught:
        read_regions(path)
    assert caught.value.path == path


def test_a_bad_byte_costs_one_row_of_a_curve_and_is_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "0000.jsonl"
    rows = [{"step": 10 * i, "loss": 0.25 * i} for i in range(4)]
    lines = [checked_line(row).encode() for row in rows]
    lines[1] = lines[1].replace(b"0.25", b"\xff.25")
    lines[2] = lines[2].replace(b"0.5", b"9.5")
    path.write_bytes(b"".join(lines))
    assert read_metrics(path) == [rows[0], rows[3]]
    assert "2 damaged rows" in caplog.text
    assert str(path) in caplog.text


@pytest.mark.parametrize("step", ["1" + "0" * 400, "9" * 5000, '"word"', "null", "-1", "1.5", "true", "[1]"])
def test_rows_with_an_odd_step_are_left_out(tmp_path: Path, step: str) -> None:
    path = tmp_path / "0000.jsonl"
    path.write_text(f'{{"step": {step}, "loss": 1}}\n{{"step": 2, "loss": 1}}\n')
    assert [row["step"] for row in read_metrics(path)] == [2]


def test_preferences_that_cannot_be_read_count_as_empty(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "settings.json"
    settings = Settings(path)
    kept = RecentProject(str(tmp_path), str(tmp_path / "capture"), "p")
    settings.add_recent(kept)
    assert Settings(path).recent == [kept]
    for bad in (path.read_bytes().replace(b"recent", b"resent"), b"\xff", b"[" * 10_000, b'{"recent": "all"}', b"null"):
        path.write_bytes(bad)
        assert Settings(path).recent == []
        assert str(path) in caplog.text
        caplog.clear()
    path.unlink()
    os.mkfifo(path)
    assert Settings(path).recent == []


def test_settings_and_regions_are_flushed_to_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    flushed: list[int] = []
    monkeypatch.setattr("engine.storage.files.os.fsync", flushed.append)
    project = create_project(tmp_path / "p", SETTINGS)
    assert len(flushed) == 2  # the file before its rename, its folder after it
    project.set_gate_regions([REGION])
    assert len(flushed) == 4
    project.close()
