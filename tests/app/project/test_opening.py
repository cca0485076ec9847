"""Which projects belong to a capture, and where a new one goes."""

import pytest

from app.project.opening.opening import check_capture, open_capture_of, projects_of
from app.project.opening.project_access import create_project, default_settings
from app.project.projects_folder import VARIABLE, new_project_dir, projects_dir, usual_project_dir
from app.project.recents import RecentProject
from engine.capture.capture import open_capture
from engine.errors import CaptureError, ProjectError
from tests.app.fakes import write_capture


@pytest.fixture
def capture(capture_folder):
    return open_capture(capture_folder)


def test_a_new_project_takes_the_next_free_number(capture, tmp_path):
    usual = usual_project_dir(capture, tmp_path)
    assert new_project_dir(capture, tmp_path) == usual
    usual.mkdir(parents=True)
    (usual / "lock").touch()
    assert new_project_dir(capture, tmp_path) == usual  # nothing but a lock: nobody's project
    (usual / "notes").touch()
    assert new_project_dir(capture, tmp_path).name == f"{usual.name}-2"
    new_project_dir(capture, tmp_path).mkdir()
    (usual.with_name(f"{usual.name}-2") / "notes").touch()
    assert new_project_dir(capture, tmp_path).name == f"{usual.name}-3"


def test_projects_of_a_capture_are_those_made_for_it_each_once(capture, tmp_path):
    assert projects_of(capture) == []
    kept, elsewhere, foreign = usual_project_dir(capture, projects_dir()), tmp_path / "elsewhere", tmp_path / "foreign"
    for folder in (kept, elsewhere):
        create_project(folder, default_settings(capture)).close()
    other = open_capture(write_capture(tmp_path / "other", n_frames=4))
    create_project(foreign, default_settings(other)).close()
    place = str(capture.path)
    recent = [
        RecentProject(str(folder), place, "named") for folder in (elsewhere, elsewhere, foreign, tmp_path / "gone")
    ]
    found = projects_of(capture, recent)
    assert {entry.folder for entry in found} == {elsewhere.resolve(), kept.resolve()}
    assert len(found) == 2
    assert {entry.preset for entry in found} == {"small"}
    assert all(entry.opened for entry in found)  # when the document was written, where nobody has opened it


def test_the_folder_of_projects_is_chosen_by_the_user_or_the_environment(capture, tmp_path, monkeypatch):
    usual, chosen = projects_dir(), str(tmp_path / "chosen")
    assert usual.name == "projects"
    assert projects_dir(chosen) == tmp_path / "chosen"
    kept, there = usual_project_dir(capture, usual), usual_project_dir(capture, tmp_path / "chosen")
    for folder in (kept, there):
        create_project(folder, default_settings(capture)).close()
    found = projects_of(capture, (), projects_dir(chosen))  # those in the usual place are found as well
    assert {entry.folder for entry in found} == {kept.resolve(), there.resolve()}
    monkeypatch.setenv(VARIABLE, str(tmp_path / "named"))
    assert projects_dir(chosen) == tmp_path / "named"


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
