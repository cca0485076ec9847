"""The real program on a virtual screen, driven by real pointer and key events; pictures are taken through X.

    python tests/ui/test_window_xvfb.py CAPTURE FOLDER

runs the same journey on a capture of choice, trains the next clip as well, and leaves its pictures in FOLDER.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
if __name__ == "__main__":  # run as a program: the repository root is not on the path then
    sys.path.insert(0, str(ROOT))

from app.project.projects_folder import projects_dir  # noqa: E402
from tests.ui.desk import WAIT_S, Desk, missing_programs  # noqa: E402

ORBIT_RADIANS_PER_PX = 0.006


def read_png(path: Path) -> np.ndarray:
    """A picture file. [H, W, 3] uint8"""
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))


def journey(desk: Desk, pictures: Path) -> None:
    """Open, look through a camera, compare, scrub, orbit, dolly, play, mark; asserts what each must do."""
    desk.wait_for("an open capture", lambda s: s["capture"] is not None and "timeline.track" in s["rects"])
    desk.focus()
    state = desk.wait_for("something to look at", lambda s: s["shows"] != "Cameras only" and s["is_still"])
    n_frames = state["n_frames"]
    desk.screenshot(pictures / "1_open.png")

    x0, y0, x1, _ = state["rects"]["timeline.track"]
    desk.drag((x0 + 4, y0 + 10), (x1 - 4, y0 + 10))
    desk.wait_for("the last frame after scrubbing", lambda s: s["frame_index"] == n_frames - 1)
    desk.screenshot(pictures / "2_scrubbed.png")

    desk.key("Home")
    desk.wait_for("the first frame", lambda s: s["frame_index"] == 0)
    yaw = state["yaw"]
    x, y = desk.center("viewport.canvas")
    desk.drag((x, y), (x + 100, y))
    # the view wraps at half a turn; the drag is far below that
    expected = 100 * ORBIT_RADIANS_PER_PX
    desk.wait_for(
        "the orbit that was dragged",
        lambda s: abs((s["yaw"] - yaw - expected + np.pi) % (2 * np.pi) - np.pi) < 2 * ORBIT_RADIANS_PER_PX,
    )
    distance = desk.state["distance"]
    desk.do("click 4", "click 4")
    desk.wait_for("two wheel ticks nearer", lambda s: abs(s["distance"] / distance - 0.81) < 1e-6)
    desk.screenshot(pictures / "3_orbited.png")

    desk.key("g")
    desk.wait_for("the wipe", lambda s: s["compare"] == "wipe" and s["look_through"] is not None)
    desk.screenshot(pictures / "4_wipe.png")
    desk.key("bracketright")
    desk.key("f")
    desk.wait_for("the home view", lambda s: s["look_through"] is None)

    words = "clip 0   frame 0   0.00 s   free view   "
    desk.wait_for("the words over the picture", lambda s: s["hud"] is not None and s["hud"]["label"].startswith(words))

    desk.click("timeline.play")
    desk.wait_for("playing", lambda s: s["is_playing"] and s["frame_index"] > 0)
    desk.key("space")
    desk.wait_for("a pause", lambda s: not s["is_playing"])

    desk.wait_for("a project to mark in", lambda s: s["can_mark"])
    desk.move(*desk.center("viewport.canvas"))
    desk.key("m")
    radius = desk.wait_for("a sphere at the pointer", lambda s: s["sphere"])["sphere"]["sphere"][1]
    desk.do("click 4", "click 4")
    desk.wait_for("a larger sphere", lambda s: abs(s["sphere"]["sphere"][1] / radius - 1.21) < 1e-6)
    desk.key("m")
    chosen = desk.wait_for("the other meaning", lambda s: s["sphere"]["treat"] == "dynamic")["sphere"]
    desk.screenshot(pictures / "5_marking.png")
    desk.key("Return")
    desk.wait_for("a marked region", lambda s: s["regions"] == [chosen] and s["sphere"] is None)
    desk.key("ctrl+z")
    desk.wait_for("the mark taken back", lambda s: s["regions"] == [])

    desk.key("F1")
    desk.wait_for("the help sheet", lambda s: s["is_help_open"])
    desk.screenshot(pictures / "6_help.png")
    desk.key("Escape")
    desk.wait_for("the sheet to close", lambda s: not s["is_help_open"])
    assert desk.program.poll() is None, "Escape must not end the program"


def train(desk: Desk, pictures: Path, *, wait_s: float) -> None:
    """Press the button and watch until the first clip is trained, still scrubbing meanwhile."""
    desk.click("training.next")
    desk.wait_for("training to begin", lambda s: s["training"]["state"] in ("starting", "preparing", "running"))
    desk.screenshot(pictures / "7_training_begins.png")
    desk.wait_for("steps", lambda s: s["training"]["step"] > 20, wait_s)
    desk.screenshot(pictures / "8_training_runs.png")
    desk.key("Tab")
    desk.wait_for("clip 0 to be trained", lambda s: s["clips"][0] == "trained", wait_s)
    desk.screenshot(pictures / "9_trained.png")


@pytest.fixture
def desk(tiny_capture: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Desk]:
    """The program with the tiny capture, its user folders inside the test's own."""
    missing = missing_programs()
    if missing:
        pytest.skip(f"not installed: {', '.join(missing)} (apt-get install xvfb xdotool x11-apps libgl1-mesa-dri)")
    for name in ("XDG_DATA_HOME", "XDG_CONFIG_HOME", "XDG_STATE_HOME", "XDG_CACHE_HOME"):
        monkeypatch.setenv(name, str(tmp_path / name.lower()))
    opened = Desk(tmp_path, [str(tiny_capture)])
    yield opened
    opened.close()


@pytest.mark.e2e
@pytest.mark.gl
def test_the_window_obeys_a_real_pointer_and_keyboard(desk: Desk, tmp_path: Path) -> None:
    journey(desk, tmp_path / "pictures")
    assert desk.state["notices"] == []
    assert desk.close() == 0, "SIGTERM ends the program cleanly"


@pytest.mark.e2e
@pytest.mark.gl
def test_taps_open_menus_and_the_window_comes_back_as_it_was_left(
    desk: Desk, tiny_capture: Path, tmp_path: Path
) -> None:
    desk.wait_for("an open capture", lambda s: s["capture"] is not None and "timeline.track" in s["rects"])
    desk.focus()
    desk.key("ctrl+plus")
    desk.wait_for("a larger interface", lambda s: s["scale"] == 1.25)
    desk.key("End")
    desk.wait_for("the last frame", lambda s: s["frame_index"] == s["n_frames"] - 1)
    for name, button in (("timeline.clip0", 3), ("menu.View", 1), ("viewport.overlays", 1)):
        desk.wait_for("no popup", lambda s: s["n_popups"] == 0 and s["is_still"])
        picture = read_png(desk.screenshot(tmp_path / "before.png"))
        desk.move(*desk.center(name))
        desk.do(f"mousedown {button}", f"mouseup {button}")  # with no time between
        desk.wait_for(f"the popup of {name}", lambda s: s["n_popups"] == 1)
        until_s = time.monotonic() + WAIT_S
        while (read_png(desk.screenshot(tmp_path / f"{name}.png")) != picture).any(axis=2).sum() <= 8_000:
            assert time.monotonic() < until_s, f"the popup of {name} was not drawn, and nothing else comes"
        desk.key("Escape")
    left = desk.wait_for("Escape to close it", lambda s: s["n_popups"] == 0 and s["is_still"])
    assert desk.close() == 0
    folder = tmp_path / "again"
    folder.mkdir()
    (project,) = projects_dir().iterdir()  # the capture would ask whether that or a new one
    again = Desk(folder, [str(project)])
    try:
        state = again.wait_for(
            "the capture again", lambda s: "timeline.track" in s["rects"] and s["frame_index"] > 0 and s["is_still"]
        )
        assert (state["frame_index"], state["scale"]) == (left["frame_index"], 1.25)
        assert state["rects"]["timeline.track"] == pytest.approx(left["rects"]["timeline.track"], abs=2)
    finally:
        again.close()


@pytest.mark.e2e
@pytest.mark.gl
def test_a_folder_that_is_no_capture_becomes_a_notice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    missing = missing_programs()
    if missing:
        pytest.skip(f"not installed: {', '.join(missing)}")
    for name in ("XDG_DATA_HOME", "XDG_CONFIG_HOME"):
        monkeypatch.setenv(name, str(tmp_path / name.lower()))
    empty = tmp_path / "holiday"
    empty.mkdir()
    desk = Desk(tmp_path, [str(empty)])
    try:
        state = desk.wait_for("an error notice", lambda s: bool(s["notices"]))
        kind, title, detail, hint = state["notices"][0]
        assert kind == "error"
        assert "holiday" in title
        assert "not a capture" in detail
        assert hint.endswith(str(empty))
        assert state["capture"] is None
    finally:
        desk.close()
    assert list(empty.iterdir()) == []


if __name__ == "__main__":
    folder = Path(sys.argv[2]).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("XDG_DATA_HOME", "XDG_CONFIG_HOME"):
        os.environ[name] = str(folder / "user")
    running = Desk(folder, [str(Path(sys.argv[1]).resolve())])
    try:
        journey(running, folder)
        train(running, folder, wait_s=600)
    finally:
        running.close()
