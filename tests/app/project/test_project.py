"""Project folders: settings, atomic saving, the lock, the sweep."""

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from app.document.project_settings import ProjectSettings
from app.project.clips.metrics_file import read_metrics
from app.project.opening.project_access import create_project, default_settings, open_project, read_settings
from engine.capture.capture import open_capture
from engine.errors import ProjectError
from engine.storage.process_space import process_space

SETTINGS = ProjectSettings(capture="somewhere", fingerprint="abc", holdout=("0", "3"), overrides={"joint_steps": 5})


def test_settings_come_back_as_they_were(tmp_path):
    create_project(tmp_path / "p", SETTINGS).close()
    assert read_settings(tmp_path / "p") == SETTINGS
    assert sorted(child.name for child in (tmp_path / "p").iterdir()) == ["journal", "project.json"]


def test_a_project_whose_making_was_interrupted_can_be_made(tmp_path):
    folder = tmp_path / "p"
    (folder / "journal").mkdir(parents=True)
    for name in (".lock", ".partial-7-lock", f".partial-7@{process_space()}-project.json"):
        (folder / name).touch()
    create_project(folder, SETTINGS).close()
    assert read_settings(folder) == SETTINGS
    for foreign in ("notes.txt", "journal/notes.txt"):
        other = tmp_path / foreign.replace("/", "-")
        (other / foreign).parent.mkdir(parents=True)
        (other / foreign).touch()
        with pytest.raises(ProjectError, match="holds other files"):
            create_project(other, SETTINGS)


def test_settings_that_are_gone_are_dropped_when_an_old_project_is_read(tmp_path):
    shutil.copy(Path(__file__).with_name("project_with_retired_settings.json"), tmp_path / "project.json")
    settings = read_settings(tmp_path)
    assert settings.overrides == {"joint_steps": 40, "inherit": "moving"}
    assert settings.config().gate == "hull"
    project = open_project(tmp_path)
    project.update(settings)
    project.close()
    assert "patience" not in (tmp_path / "project.json").read_text()


def test_a_failed_save_leaves_the_old_file(tmp_path, monkeypatch):
    project = create_project(tmp_path / "p", SETTINGS)
    before = (tmp_path / "p" / "project.json").read_bytes()

    def full(*_args, **_kwargs):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(ProjectError, match="No space left"):
        project.update(ProjectSettings(capture="other", fingerprint="x"))
    project.close()
    assert (tmp_path / "p" / "project.json").read_bytes() == before
    assert not list((tmp_path / "p").glob(".partial-*"))
    assert project.settings == SETTINGS
    monkeypatch.undo()
    assert read_settings(tmp_path / "p") == SETTINGS


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"schema": 99}, "schema 99"),
        ({"extra": 1}, "unknown entries: extra"),
        ({"scale": "wide"}, "missing or wrong"),
        ({"scale": 5}, "scale is 5"),
        ({"clip_length": 0}, "clip_length is 0"),
        ({"overrides": {"nonsense": 1}}, "no training setting called nonsense"),
        ({"overrides": {"gaussians_per_anchor": 99}}, "between 1 and 32"),
    ],
)
def test_a_bad_project_file_is_named(tmp_path, change, expected):
    create_project(tmp_path / "p", SETTINGS).close()
    path = tmp_path / "p" / "project.json"
    edited = json.loads(path.read_text())
    (edited if change.keys() & {"schema", "extra"} else edited["settings"]).update(change)
    path.write_text(json.dumps(edited))
    with pytest.raises(ProjectError, match=r'edited by hand, take out its entry "checksum"'):
        read_settings(tmp_path / "p")
    del edited["checksum"]
    path.write_text(json.dumps(edited))
    with pytest.raises(ProjectError, match=expected) as caught:
        read_settings(tmp_path / "p")
    assert str(caught.value).endswith(str(path))


@pytest.mark.parametrize("text", ["", "{", "[]", '"x"', "\x00"])
def test_a_damaged_project_file_is_named(tmp_path, text):
    (tmp_path / "project.json").write_text(text)
    with pytest.raises(ProjectError, match=r"project\.json"):
        read_settings(tmp_path)


def test_foreign_files_are_left_alone(tmp_path):
    (tmp_path / "thesis.doc").write_text("precious")
    with pytest.raises(ProjectError, match="other files"):
        create_project(tmp_path, SETTINGS)
    assert [child.name for child in tmp_path.iterdir()] == ["thesis.doc"]


def test_two_writers_are_one_too_many(tmp_path):
    project = create_project(tmp_path / "p", SETTINGS)
    with pytest.raises(ProjectError, match="open for writing"):
        open_project(tmp_path / "p")
    assert open_project(tmp_path / "p", is_writable=False).is_writable is False
    project.close()
    open_project(tmp_path / "p").close()


@pytest.fixture
def dead_pid() -> int:
    """A process id that was in use and is not any more."""
    child = subprocess.Popen([sys.executable, "-c", "pass"])
    child.wait()
    return child.pid


def test_opening_sweeps_leftovers_and_keeps_clips(tmp_path, dead_pid):
    create_project(tmp_path / "p", SETTINGS).close()
    keep = tmp_path / "p" / "clips" / "0000.safetensors"
    stale = tmp_path / "p" / "reports" / f".partial-{os.getpid()}-old.html"
    half = keep.with_name(f".partial-{dead_pid}-0001.safetensors")
    gone = [tmp_path / "p" / "live" / "clip-0001-r0003.safetensors", half, stale]
    others = tmp_path / "p" / "reports" / f".partial-{os.getppid()}-report.html"  # another process writes it just now
    for path in (keep, others, *gone):
        path.parent.mkdir(exist_ok=True)
        path.write_text("x")
    os.utime(stale, (0, time.time() - 2 * 24 * 3600))
    open_project(tmp_path / "p", is_writable=False)
    assert all(path.exists() for path in gone)  # a reader must not disturb a running training
    open_project(tmp_path / "p").close()
    assert keep.exists()
    assert others.exists()
    assert not any(path.exists() for path in gone)


def test_metrics_survive_a_torn_last_line(tmp_path):
    path = tmp_path / "m.jsonl"
    path.write_text('{"step": 1, "loss": 0.5}\n{"step": 2, "lo')
    assert read_metrics(path) == [{"step": 1, "loss": 0.5}]
    assert read_metrics(tmp_path / "none") == []


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ({"clip_length": 0}, "allows 1 to 6"),
        ({"clip_length": 7}, "allows 1 to 6"),
        ({"holdout": ("9",)}, "no camera called 9"),
        ({"holdout": ("0", "1", "2")}, "leaves 1 for training"),
        ({"seed": -1}, "seed is -1"),
        ({"overrides": {"ssim_weight": 2.0}}, "between 0 and 1"),
    ],
)
def test_settings_that_do_not_fit_are_refused_with_the_range(capture_folder, arguments, expected):
    with pytest.raises(ProjectError, match=expected):
        default_settings(open_capture(capture_folder), **arguments)


def test_the_capture_suggests_the_hold_out(capture_folder):
    assert default_settings(open_capture(capture_folder)).holdout == ("0",)
