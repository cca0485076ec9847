"""clipgstream export --player: what it prints, and what is wrong with its arguments."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.app.residuals.conftest import make_project


@pytest.fixture
def project(tmp_path: Path) -> Path:
    return make_project(tmp_path)


def test_the_size_is_said_before_the_page_is_written(run, project: Path, tmp_path: Path):
    page = tmp_path / "scene.html"
    code, out, err = run("export", project, "--player", page, "--frames", "1:5", "--json")
    assert code == 0
    document = json.loads(out)
    assert (document["format"], document["path"], document["n_files"]) == ("player", str(page), 1)
    assert document["n_bytes"] == page.stat().st_size
    assert err.index("MB for 4 frames.") < err.index("1 file,")


def test_clips_go_into_a_folder_on_request(run, project: Path, tmp_path: Path):
    code, _, err = run("export", project, "--player", tmp_path / "scene.html", "--data-folder", "--clip", 1)
    assert code == 0
    assert "folder scene_data, which must stay next to the page" in err
    assert sorted(path.name for path in (tmp_path / "scene_data").iterdir()) == [
        "clip00001.bin",
        "clip00001.js",
        "shared.bin",
        "shared.js",
    ]


def test_it_names_what_is_wrong_with_its_arguments(run, project: Path, tmp_path: Path):
    for arguments, expected in (
        (("--player", tmp_path / "scene.png"), "HTML page"),
        (("--player", tmp_path / "scene.html", "--frames", "4:99"), "frames 0 to 5"),
        (("--player", tmp_path / "scene.html", "--format", "ply"), "not allowed with"),
        (("--format", "ply"), "--out is missing"),
        ((), "--player"),
    ):
        code, _, err = run("export", project, *arguments)
        assert code == 2, arguments
        assert expected in err
        assert "Traceback" not in err
    assert not list(tmp_path.glob("scene*"))
