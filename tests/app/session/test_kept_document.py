"""The document of the window reaches the disk step by step."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from app.document.history import DocumentHistory, Event
from app.document.project_document import Marker
from app.document.project_settings import ProjectSettings
from app.project.opening.project_access import create_project, open_project
from app.session.editing import kept_document
from app.session.editing.kept_document import KeptDocument


def test_a_step_is_on_disk_before_the_next_one_is_accepted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(kept_document, "KEPT_WITHIN_S", 60.0)
    project = create_project(tmp_path / "p", ProjectSettings(capture="none", fingerprint="none"))
    write, n_written = project.store.write, [0]

    def slowly(events: Sequence[Event], history: DocumentHistory) -> None:
        time.sleep(0.05)
        write(events, history)
        n_written[0] += 1

    monkeypatch.setattr(project.store, "write", slowly)
    document = KeptDocument(guard=lambda before, after: None, on_change=lambda before, after: None)
    document.hold(project)
    for frame in range(4):
        document.change(replace(project.document, markers=(Marker(frame, "x"),)), "mark")
        kept = open_project(tmp_path / "p", is_writable=False).document.markers
        assert kept in ((Marker(frame, "x"),), (Marker(frame - 1, "x"),), () if frame == 0 else None)
    n_before = n_written[0]
    for x in range(30):  # a drag is one step, and waits for nothing
        document.change(replace(project.document, markers=(Marker(x, "drag"),)), "move", merge="drag 1")
    document.close()
    assert n_written[0] - n_before < 30
    assert open_project(tmp_path / "p", is_writable=False).history.past[-1].name == "move"
    project.close()
