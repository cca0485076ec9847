"""Editing on real disks that are full or cannot be written: it is said, and nothing that was kept is lost."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from app.document.project_document import Marker
from app.document.project_settings import ProjectSettings
from app.project.opening.project_access import create_project, open_project
from engine.errors import DiskError, ProjectError
from tests.faults.full_disk import can_mount, full_disk

pytestmark = pytest.mark.skipif(not can_mount(), reason="needs root, to mount small disks")

SETTINGS = ProjectSettings(capture="none", fingerprint="none")


@pytest.mark.slow
def test_a_disk_that_fills_up_while_somebody_edits(tmp_path: Path) -> None:
    with full_disk(tmp_path, 160) as disk:
        project = create_project(disk / "project", SETTINGS)
        n_kept = 0
        refused: list[DiskError] = []
        for number in range(400):
            document = replace(project.document, markers=(Marker(number, "x" * 190),) * (1 + number % 7))
            try:
                project.change(document, f"mark {number}")
                n_kept += 1
            except DiskError as error:
                refused.append(error)
                assert open_project(disk / "project", is_writable=False).document == project.document
                if len(refused) == 5:
                    break
        assert n_kept > 20
        assert ["No space left" in error.message for error in refused] == [True] * 5
        expected = project.document
        project.close()
        read = open_project(disk / "project", is_writable=False)
        assert read.document == expected
        subprocess.run(["mount", "-o", "remount,size=4000k", str(disk)], check=True, capture_output=True)
        project = open_project(disk / "project")
        assert project.store.notes == ()
        project.change(replace(expected, markers=()), "take the markers away")
        project.close()
        assert not list((disk / "project").rglob(".partial-*"))
        assert open_project(disk / "project").history.undo_name == "take the markers away"


def test_a_disk_that_cannot_be_written_can_be_read(tmp_path: Path) -> None:
    with full_disk(tmp_path, 1000) as disk:
        project = create_project(disk / "project", SETTINGS)
        project.change(replace(project.document, markers=(Marker(1, "a"),)), "add a marker")
        assert project._lock is not None
        project._lock.release()  # as after a kill: the step is in the journal only
        subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True, capture_output=True)
        with pytest.raises(ProjectError, match="cannot be written"):
            open_project(disk / "project")
        assert open_project(disk / "project", is_writable=False).document.markers == (Marker(1, "a"),)
