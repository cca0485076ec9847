"""Which projects belong to a capture, and where a new one goes."""

import pytest

from app.project.opening import check_capture, new_project_dir, open_capture_of, projects_of
from app.project.project import create_project, default_project_dir, default_settings
from app.project.recents import RecentProject
from engine.capture.capture import open_capture
from engine.errors import CaptureError, ProjectError
from tests.app.fakes import write_capture


@pytest.fixture
def capture(capture_folder):
    return open_capture(capture_folder)


def test_a_new_project_takes_the_next_free_number(capture):
    usual = default_project_dir(capture)
    assert new_project_dir(capture) == usual
    usual.mkdir(parents=True)
    (usual / "lock").touch()
    assert new_project_dir(capture) == usual  # nothing but a lock: nobody's project
    (usual / "notes").touch()
    assert new_project_dir(capture).name == f"{usual.name}-2"
    new_project_dir(capture).mkdir()
    (usual.with_name(f"{usual.name}-2") / "notes").touch()
    assert new_project_dir(capture).name == f"{usual.name}-3"


def test_projects_of_a_capture_are_those_made_for_it_each_once(capture, tmp_path):
    assert projects_of(capture) == []
    kept, elsewhere, foreign = default_project_dir(capture), tmp_path / "elsewhere", tmp_path / "foreign"
    for folder in (kept, elsewhere):
        create_project(folder, default_settings(capture)).close()
    other = open_capture(write_capture(tmp_path / "other", n_frames=4))
    create_project(foreign, default_settings(other)).close()
    place = str(capture.path)
    recent = [
        RecentProject(str(folder), place, "named") for folder in (elsewhere, elsewhere, foreign, tmp_path / "gone")
    ]
    assert [entry.folder for entry in projects_of(capture, recent)] == [elsewhere.resolve(), kept.resolve()]


def test_a_capture_that_moved_or_changed_is_told(capture, tmp_path):
    folder = tmp_path / "p"
    settings = default_settings(capture)
    check_capture(capture, settings, folder)
    assert open_capture_of(settings, folder).fingerprint == capture.fingerprint
    other = open_capture(write_capture(tmp_path / "other", n_frames=4))
    with pytest.raises(ProjectError, match="not the one this project was made for"):
        check_capture(other, settings, folder)
    gone = default_settings(other)
    (tmp_path / "other").rename(tmp_path / "moved")
    with pytest.raises(CaptureError, match="no longer where it was") as found:
        open_capture_of(gone, folder)
    assert f"train NEW_PLACE --project {folder}" in found.value.hint
