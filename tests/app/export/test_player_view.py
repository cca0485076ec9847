"""The player's view in a real browser, against the window's: the same drags lead to the same place."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.evaluation.headless import open_trained
from app.export.player_job import PlayerJob, run
from app.playback.views.orbit_view import OrbitView
from app.project.opening.project_access import open_project
from engine.camera.rig import CameraRig
from engine.timing.segment import Segment
from tests.app.residuals.conftest import make_project
from tests.browser import Browser, chromium

pytestmark = [
    pytest.mark.e2e,
    pytest.mark.slow,
    pytest.mark.skipif(chromium() is None, reason="Chromium is not installed: apt-get install -y chromium"),
]


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Browser, CameraRig]]:
    folder = tmp_path_factory.mktemp("player")
    opened = open_trained(open_project(make_project(folder), is_writable=False))
    run(opened, PlayerJob(folder / "scene.html"), lambda progress: None)
    with Browser(folder) as browser:
        browser.open(folder / "scene.html")
        browser.wait("window.clipgstreamPlayer && clipgstreamPlayer.isDrawn")
        yield browser, opened.capture.rig
        assert browser.console == []


def assert_same(browser: Browser, view: OrbitView) -> None:
    for width, height in ((640, 480), (1200, 500)):
        lens = browser.value(f"clipgstreamPlayer.view.lens({width}, {height})")
        K = view.K(width, height)
        assert np.allclose(np.reshape(lens["worldToCamera"], (4, 4)), view.world_to_camera(), atol=1e-6)
        assert np.allclose([*lens["focal"], *lens["center"]], [K[0, 0], K[1, 1], K[0, 2], K[1, 2]], rtol=1e-6)


def test_the_view_moves_as_in_the_window(shown: tuple[Browser, CameraRig]):
    browser, rig = shown
    view = OrbitView(rig)
    assert_same(browser, view)
    browser.value("void clipgstreamPlayer.view.orbit(123, 45)")
    view.orbit(123.0, 45.0)
    assert_same(browser, view)
    view.K(640, 480)
    browser.value("void clipgstreamPlayer.view.pan(30, -20, 640, 480)")
    view.pan(30.0, -20.0)
    assert_same(browser, view)
    browser.value("void clipgstreamPlayer.view.dolly(0.7)")
    view.dolly(0.7)
    assert_same(browser, view)
    browser.value("void clipgstreamPlayer.view.orbit(0, 1e5)")
    view.orbit(0.0, 1e5)
    assert_same(browser, view)


def test_cameras_are_looked_through_and_left_as_in_the_window(shown: tuple[Browser, CameraRig]):
    browser, rig = shown
    for camera in range(len(rig)):
        view = OrbitView(rig)
        view.look(camera)
        browser.value(f"void clipgstreamPlayer.view.look({camera})")
        assert_same(browser, view)
        browser.value("void clipgstreamPlayer.view.orbit(40, -30)")
        view.look(None)
        view.orbit(40.0, -30.0)
        lens = browser.value("clipgstreamPlayer.view.lens(640, 480)")
        assert np.allclose(np.reshape(lens["worldToCamera"], (4, 4)), view.world_to_camera(), atol=1e-6)
    browser.key("f")
    assert_same(browser, OrbitView(rig))


def test_a_take_is_played_in_its_order(tmp_path: Path) -> None:
    project = open_project(make_project(tmp_path))
    take = (Segment(4, 6, is_reversed=True), Segment(1, 2, n_frozen=3))
    project.change(replace(project.document, timing=take), "time")
    project.close()
    opened = open_trained(open_project(project.folder, is_writable=False))
    run(opened, PlayerJob(tmp_path / "take.html"), lambda progress: None)
    with Browser(tmp_path) as browser:
        browser.open(tmp_path / "take.html")
        browser.wait("window.clipgstreamPlayer && clipgstreamPlayer.isDrawn")
        assert browser.value("clipgstreamPlayer.clock.nFrames") == 5
        assert browser.value("clipgstreamPlayer.header.take") == [2, 1, 0, 0, 0]
        for frame in (0, 3, 2, 4, 1):
            browser.value(f"clipgstreamPlayer.go({frame})")
            browser.wait(f"clipgstreamPlayer.isDrawn && clipgstreamPlayer.onScreen === {frame}")
            words = browser.value("document.getElementById('time').textContent")
            assert words.startswith(f"Frame {frame} of 4")
        assert browser.value("clipgstreamPlayer.timeline.starts") == [0, 2]
        assert browser.console == []
