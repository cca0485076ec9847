"""The player in an emulated headset, in a real browser: what both eyes see, against the rasterizer, and going about."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from engine.backends.table import backend_called
from engine.export.player.blocks import joined
from engine.raster.rasterize import rasterize
from tests.browser import Browser, chromium
from tests.player_scenes import (
    BACKGROUND,
    FLOOR,
    METERS_PER_UNIT,
    NEAR,
    camera,
    header,
    moving,
    places,
    still,
    write_page,
)

EMULATOR = Path(__file__).parents[2] / "oracles" / "node_modules" / "iwer" / "build" / "iwer.min.js"

pytestmark = [
    pytest.mark.e2e,
    pytest.mark.slow,
    pytest.mark.skipif(chromium() is None, reason="Chromium is not installed: apt-get install -y chromium"),
    pytest.mark.skipif(not EMULATOR.is_file(), reason="iwer is not there; ./setup.sh --tests installs it with npm"),
]

EYE = (240, 240)
"""Size of what an eye sees, pixels."""
HEAD = np.array([0.2, 1.5, -0.1])
"""Where the head is to begin with, m: x right, y up from the floor, z backward."""
EYES_APART = 0.064
FOV_Y = 1.4
LEAST_PSNR = 35.0
DEVICE = f"""
window.device = new IWER.XRDevice(IWER.metaQuest3, {{ipd: {EYES_APART}, fovy: {FOV_Y}, stereoEnabled: true}});
device.installRuntime({{forceInstall: true}});
device.position.set({", ".join(map(str, HEAD))});
"""
NO_FLOOR = """void (() => {
  const type = Object.getPrototypeOf(clipgstreamPlayer.headset.session), ask = type.requestReferenceSpace;
  type.requestReferenceSpace = async function (kind) {
    if (kind !== "local") throw new DOMException("", "NotSupportedError");
    const space = await ask.call(this, kind), offset = space.getOffsetReferenceSpace;
    space.getOffsetReferenceSpace = (by) => offset.call(space, by.matrix); // the emulator forgets to take the matrix
    return space;
  };
})()"""
HEADSET = "clipgstreamPlayer.headset"
SAID_FOR_EVER = "(later => { setTimeout = (act, ms) => ms >= 8000 ? 0 : later(act, ms); })(setTimeout);"
"""A script before the page's own: what is said for some seconds is still said when the test reads it."""


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[Browser]:
    """In the headset, at the first frame."""
    page = write_page(tmp_path / "scene.html", header())
    with Browser(tmp_path) as browser:
        browser.resize(2 * EYE[0], EYE[1])
        browser.before_pages(EMULATOR.read_text("utf-8") + DEVICE)
        browser.open(page)
        browser.wait("window.clipgstreamPlayer && clipgstreamPlayer.isDrawn")
        browser.wait("!document.getElementById('headset').hidden")
        enter(browser)
        yield browser
        assert browser.console == []


def enter(browser: Browser) -> None:
    """Begin a session with the button, as a user does."""
    browser.call("Runtime.evaluate", expression="document.getElementById('headset').click()", userGesture=True)
    browser.wait(f"{HEADSET}.session && {HEADSET}.isPlaced")
    browser.value(f"void ({HEADSET}.share = 1, {HEADSET}.keepPace = () => {{}})")  # however late frames come


def seen(browser: Browser) -> tuple[np.ndarray, np.ndarray]:
    """What the left and the right eye see, once it is sorted. [H, W, 3] each, 0..1"""
    frames(browser, 3)  # what was moved just now is wished for
    browser.wait("(p => !p.pictures.isBusy && p.pictures.answered === p.pictures.wish.key)(clipgstreamPlayer)")
    frames(browser, 3)
    picture = browser.picture() / 255.0
    assert picture.shape == (EYE[1], 2 * EYE[0], 3)
    return picture[:, : EYE[0]], picture[:, EYE[0] :]


def frames(browser: Browser, n: int) -> None:
    """Let so many frames of the headset go by."""
    browser.value(
        f"new Promise(done => {{ let n = {n}; const next = () => n-- ? {HEADSET}.session.requestAnimationFrame(next)"
        " : done(); next(); })"
    )


def expected(eye_m: np.ndarray, *, facing: np.ndarray, frame: int = 0) -> np.ndarray:
    """What an eye sees that looks level. eye_m: scene place of the eye; facing: direction in the scene."""
    up = np.array([0.0, -1.0, 0.0])
    right = np.cross(facing, up)
    rotation = np.stack([right, -up, facing])
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, -rotation @ eye_m
    focal = EYE[1] / 2.0 / np.tan(FOV_Y / 2.0)
    K = np.array([[focal, 0.0, EYE[0] / 2], [0.0, focal, EYE[1] / 2], [0.0, 0.0, 1.0]])
    clip, in_clip = places()[frame]
    rendering = rasterize(
        joined(still(clip, in_clip), moving(clip, in_clip)).gaussians(),
        torch.tensor(matrix[None], dtype=torch.float32),
        torch.tensor(K[None], dtype=torch.float32),
        *EYE,
        backend=backend_called("cpu"),
        near_plane=NEAR,
        background=torch.tensor(BACKGROUND),
    )
    return rendering.image[0].clamp(0.0, 1.0).numpy()


def eyes(head: np.ndarray, facing: np.ndarray, *, scale: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Places of both eyes in the scene, of a head there."""
    half = np.cross(facing, [0.0, -1.0, 0.0]) * EYES_APART / 2.0 / (scale * METERS_PER_UNIT)
    return head - half, head + half


def at_the_start() -> tuple[np.ndarray, np.ndarray]:
    """Where the head is in the scene and what it faces: above the ground below the first view."""
    matrix, _ = camera(0)
    place = -matrix[:3, :3].T @ matrix[:3, 3]
    place[1] = -(FLOOR + HEAD[1] / METERS_PER_UNIT)
    facing = matrix[2, :3] * [1.0, 0.0, 1.0]
    return place, facing / np.linalg.norm(facing)


def turned(direction: np.ndarray, degrees_left: float) -> np.ndarray:
    """About the scene's up, which is -y."""
    angle = np.radians(degrees_left)
    x, _, z = direction
    return np.array([np.cos(angle) * x - np.sin(angle) * z, 0.0, np.sin(angle) * x + np.cos(angle) * z])


def psnr(some: np.ndarray, others: np.ndarray) -> float:
    return float(-10.0 * np.log10(np.mean((some - others) ** 2) + 1e-12))


def assert_seen(browser: Browser, head: np.ndarray, facing: np.ndarray) -> None:
    pictures = seen(browser)
    drawn = [expected(eye, facing=facing) for eye in eyes(head, facing)]
    for eye, picture in enumerate(pictures):
        assert psnr(picture, drawn[eye]) > LEAST_PSNR
        assert psnr(picture, drawn[1 - eye]) < LEAST_PSNR - 8.0  # so the figure can tell the eyes apart


def stick(browser: Browser, x: float, y: float) -> None:
    """Push the right thumbstick, and hold it."""
    browser.value(f"void device.controllers.right.updateAxes('thumbstick', {x}, {y})")
    frames(browser, 3)


def hands(browser: Browser, *, apart: float) -> None:
    """Hold the controllers so far from each other, m."""
    for hand, side in (("left", -0.5), ("right", 0.5)):
        browser.value(f"void device.controllers.{hand}.position.set({side * apart}, 1.2, -0.4)")
    frames(browser, 3)


def press(browser: Browser, button: str) -> None:
    """Press and release a button of the right controller."""
    for value in (1, 0):
        browser.value(f"void device.controllers.right.updateButtonValue('{button}', {value})")
        frames(browser, 3)


def state(browser: Browser, expression: str) -> Any:
    return browser.value(f"clipgstreamPlayer.{expression}")


def test_each_eye_sees_what_the_rasterizer_draws_there(browser: Browser):
    place, facing = at_the_start()
    assert_seen(browser, place, facing)


def test_the_head_moves_in_metres(browser: Browser):
    place, facing = at_the_start()
    browser.value(f"void device.position.set({HEAD[0] + 0.5}, {HEAD[1] - 0.3}, {HEAD[2] - 1.0})")
    right, up = np.cross(facing, [0.0, -1.0, 0.0]), np.array([0.0, -1.0, 0.0])
    assert_seen(browser, place + (0.5 * right - 0.3 * up + 1.0 * facing) / METERS_PER_UNIT, facing)


def test_a_flick_turns_on_the_spot(browser: Browser):
    place, facing = at_the_start()
    stick(browser, 1.0, 0.0)
    frames(browser, 3)
    stick(browser, 0.0, 0.0)
    assert_seen(browser, place, turned(facing, -30.0))
    stick(browser, -1.0, 0.0)
    stick(browser, 0.0, 0.0)
    assert_seen(browser, place, facing)


def test_one_stands_where_the_arc_lands(browser: Browser):
    place, facing = at_the_start()
    browser.value("void device.controllers.right.position.set(0.2, 1.2, -0.1)")
    browser.value("void device.controllers.right.quaternion.set(-Math.sin(Math.PI / 18), 0, 0, Math.cos(Math.PI / 18))")
    before = seen(browser)[0]
    stick(browser, 0.0, -1.0)
    assert psnr(seen(browser)[0], before) < 45.0, "the arc is seen"
    stick(browser, 0.0, 0.0)
    level, down = 7.0 * np.cos(np.pi / 9), 7.0 * np.sin(np.pi / 9)  # thrown from 1.2 m at 7 m/s, down at 20 degrees
    way_m = level * (np.sqrt(down**2 + 2.0 * 9.81 * 1.2) - down) / 9.81
    assert_seen(browser, place + way_m * facing / METERS_PER_UNIT, facing)


def test_two_squeezed_hands_pull_the_scene_larger_around_where_one_stands(browser: Browser):
    place, facing = at_the_start()
    hands(browser, apart=0.3)
    for hand in ("left", "right"):
        browser.value(f"void device.controllers.{hand}.updateButtonValue('squeeze', 1)")
        frames(browser, 3)
    hands(browser, apart=0.6)
    for hand in ("left", "right"):
        browser.value(f"void device.controllers.{hand}.updateButtonValue('squeeze', 0)")
        frames(browser, 3)
    assert not state(browser, "clock.isPlaying"), "pulling does not play"
    place[1] = -(FLOOR + HEAD[1] / (2.0 * METERS_PER_UNIT))
    assert state(browser, "headset.stage.metersPerUnit") == pytest.approx(2.0 * METERS_PER_UNIT)
    for eye, found in zip(eyes(place, facing, scale=2.0), seen(browser), strict=True):
        assert psnr(found, expected(eye, facing=facing)) > LEAST_PSNR
    press(browser, "squeeze")
    assert state(browser, "clock.isPlaying")


def test_how_large_the_scene_is_said_to_be_a_guess_where_it_is_one(browser: Browser):
    words = browser.value("document.getElementById('notice').innerText")
    assert words.startswith("The size of the scene is a guess. Squeeze both controllers")
    assert words in browser.value("document.getElementById('headset').title")


def test_buttons_play_and_leave(browser: Browser):
    press(browser, "trigger")
    assert state(browser, "clock.isPlaying")
    browser.wait("clipgstreamPlayer.shown > 2")
    press(browser, "a-button")
    assert not state(browser, "clock.isPlaying")
    press(browser, "squeeze")
    assert state(browser, "clock.isPlaying")
    browser.value("void clipgstreamPlayer.play(false)")
    browser.value("void device.controllers.right.updateButtonValue('b-button', 1)")
    browser.wait(f"{HEADSET}.session === null")
    browser.wait("clipgstreamPlayer.isDrawn && clipgstreamPlayer.canvas.width === document.body.clientWidth")
    enter(browser)
    browser.value("void clipgstreamPlayer.go(0)")
    assert_seen(browser, *at_the_start())


def test_without_a_known_floor_it_is_below_the_head(browser: Browser):
    browser.value(NO_FLOOR)
    browser.value(f"{HEADSET}.session.end()")
    browser.wait(f"{HEADSET}.session === null")
    enter(browser)
    frames(browser, 2)
    assert state(browser, "headset.head")[1] == pytest.approx(1.6, abs=0.02)


def test_a_lost_context_ends_the_session_and_the_page_goes_on(browser: Browser):
    browser.value("void (window.loss = clipgstreamPlayer.renderer.gl.getExtension('WEBGL_lose_context')).loseContext()")
    browser.wait(f"clipgstreamPlayer.isLost && {HEADSET}.session === null")
    browser.value("void loss.restoreContext()")
    browser.wait("!clipgstreamPlayer.isLost && clipgstreamPlayer.isDrawn")
    assert state(browser, "onScreen") == 0
    known = ("CONTEXT_LOST", "context lost", "onDeviceFrame")  # the last is the emulator's own, which asks the context
    browser.console[:] = [said for said in browser.console if not any(one in said for one in known)]


def test_why_no_session_begins_can_be_read(tmp_path: Path):
    page = write_page(tmp_path / "scene.html", header())
    with Browser(tmp_path) as browser:
        browser.before_pages(
            SAID_FOR_EVER
            + "Object.defineProperty(Navigator.prototype, 'xr', {value: {isSessionSupported: async () => true,"
            " requestSession: async () => { throw new Error('It sleeps.'); }}});"
        )
        browser.open(page)
        browser.wait("window.clipgstreamPlayer && clipgstreamPlayer.isDrawn")
        browser.wait("!document.getElementById('headset').hidden")
        browser.value("clipgstreamPlayer.play(true)")
        browser.value("document.getElementById('headset').click()")
        browser.wait("!document.getElementById('headset').disabled")
        browser.wait("clipgstreamPlayer.onScreen > 2")
        words = browser.value("document.getElementById('notice').innerText")
        assert words == "The headset did not start: It sleeps."
        assert browser.console == []


def test_the_button_is_there_where_a_headset_is(tmp_path: Path):
    page = write_page(tmp_path / "scene.html", header())
    with Browser(tmp_path) as browser:
        browser.open(page)
        browser.wait("window.clipgstreamPlayer && clipgstreamPlayer.isDrawn")
        assert browser.value("document.getElementById('headset').hidden")
