"""clipgstream clips, versions and exclude: what they change, what they say, and what they refuse."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from app.project.clips.clip_versions import set_aside
from app.project.opening.project_access import create_project, default_settings, open_project
from app.project.project import Project
from engine.capture.capture import open_capture
from tests.app.made_projects import clip_header, write_header

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def folder(tmp_path: Path, capture_folder: Path) -> Path:
    """Two clips of three frames; clip 1 has an earlier version."""
    capture = open_capture(capture_folder)
    project = create_project(tmp_path / "p", default_settings(capture, clip_length=3))
    capture.close()
    own = {"start": 0, "n_frames": 3, "clip_length": 3}
    write_header(project.clip_path(0), clip_header(0, **own))
    for name in ("old", "new"):
        set_aside(project, 1)
        entries = own | {"start": 3, "role": "source", "reference_fingerprint": "clip-0", "fingerprint": name}
        write_header(project.clip_path(1), clip_header(1, **entries))
    project.close()
    return tmp_path / "p"


def reopened(folder: Path) -> Project:
    return open_project(folder, is_writable=False)


def test_clips_are_split_merged_and_told_apart(folder: Path, run: Run) -> None:
    code, out, _ = run("clips", folder, "--split", 2, "--dry-run", "--json")
    assert (code, [clip["start"] for clip in json.loads(out)["clips"]]) == (0, [0, 2, 3])
    assert reopened(folder).settings.clip_bounds is None
    code, out, _ = run("clips", folder, "--split", 2)
    assert code == 0
    assert "clip 0, reference: frames 0 to 1, untrained" in out
    assert reopened(folder).settings.clip_bounds == (0, 2, 3, 6)
    assert run("clips", folder, "--merge", 0)[0] == 0
    code, out, _ = run("clips", folder, "--reference", 1, "--json")
    found = json.loads(out)
    assert (found["reference_clip"], [clip["state"] for clip in found["clips"]]) == (1, ["stale", "stale"])
    code, _, err = run("clips", folder, "--split", 99)
    assert (code, "No clip can begin at frame 99" in err) == (2, True)


def test_versions_are_listed_brought_back_and_removed(folder: Path, run: Run) -> None:
    code, out, _ = run("versions", folder, "--json")
    found = json.loads(out)
    assert (code, [len(clip["versions"]) for clip in found["clips"]]) == (0, [0, 1])
    assert found["disk"]["total"] == sum(n for name, n in found["disk"].items() if name != "total")
    assert run("versions", folder, "--clip", 1, "--restore", 1)[0] == 0
    known = reopened(folder)
    header = known.headers.read(known.clip_path(1))
    assert header is not None
    assert header.header is not None
    assert header.header.fingerprint == "old"
    code, out, _ = run("versions", folder, "--free", "versions", "--dry-run")
    assert "This would free" in out
    code, out, _ = run("versions", folder, "--free", "versions", "--json")
    assert json.loads(out)["n_bytes_freed"] > 0
    assert "no earlier versions" in run("versions", folder, "--clip", 1)[1]
    assert run("versions", folder, "--restore", 1)[0] == 2
    assert run("versions", folder, "--clip", 7)[0] == 2
    assert run("versions", folder, "--clip", 1, "--restore", 5)[0] == 2


def test_a_damaged_clip_is_said_with_what_could_come_back(folder: Path, run: Run) -> None:
    (folder / "clips" / "0001.safetensors").write_bytes(b"nothing")
    code, _, err = run("eval", folder, "--clips", "1:2", "--json", folder.parent / "out.json")
    assert code == 2
    assert "--clip 1 --restore 1" in err
    assert "damaged" in run("versions", folder, "--clip", 1)[1]
    assert run("versions", folder, "--clip", 1, "--restore", 1)[0] == 0
    assert [path.read_bytes() for path in (folder / "damaged").iterdir()] == [b"nothing"]


def test_cameras_and_frames_are_excluded_and_included(folder: Path, run: Run) -> None:
    assert run("exclude", folder)[1] == "Nothing is excluded from training.\n"
    code, out, _ = run("exclude", folder, "--cameras", 1)
    assert code == 0
    code, out, _ = run("exclude", folder, "--frames", "1:3", "--json")
    assert json.loads(out)["frames"] == [{"camera": None, "first": 1, "stop": 3}]
    assert "trained on other pictures" in run("clips", folder)[1]
    assert run("exclude", folder, "--cameras", "nobody")[0] == 2
    assert run("exclude", folder, "--frames", "4:99")[0] == 2
    code, out, _ = run("exclude", folder, "--frames", ":", "--include")
    assert "frames" not in out
    assert run("exclude", folder, "--forget")[1] == "Nothing is excluded from training.\n"
