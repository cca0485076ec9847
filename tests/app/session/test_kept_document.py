"""The document of the window reaches the disk step by step."""

from __future__ import annotations

import threading
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
from tests.app.conftest import DEADLINE_S


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


def test_closing_waits_for_a_disk_that_is_slower_than_anybody_waits_while_working(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    for name in ("SETTLE_S", "KEPT_WITHIN_S"):
        monkeypatch.setattr(kept_document, name, 0.0)
    project = create_project(tmp_path / "p", ProjectSettings(capture="none", fingerprint="none"))
    is_writing, may_write, write = threading.Event(), threading.Event(), project.store.write

    def slowly(events: Sequence[Event], history: DocumentHistory) -> None:
        is_writing.set()
        assert may_write.wait(DEADLINE_S)
        write(events, history)

    monkeypatch.setattr(project.store, "write", slowly)
    document = KeptDocument(guard=lambda before, after: None, on_change=lambda before, after: None)
    document.hold(project)
    document.change(replace(project.document, markers=(Marker(1, "x"),)), "mark")
    assert is_writing.wait(DEADLINE_S)
    document.change(replace(project.document, markers=(Marker(2, "x"),)), "mark again")
    wait_idle = document._files.wait_idle

    def closing(timeout_s: float) -> bool:
        if timeout_s == kept_document.CLOSING_S:
            may_write.set()
        return wait_idle(timeout_s)

    monkeypatch.setattr(document._files, "wait_idle", closing)
    document.close()
    may_write.set()
    project.close()
    assert open_project(tmp_path / "p", is_writable=False).document.markers == (Marker(2, "x"),)
