"""The player in a real browser: what it draws, against the rasterizer; what keys, pointer and fingers do; what it says
where something is missing. Pages lie on the disk, and the browser has no network."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from engine.backends.table import backend_called
from engine.export.player.blocks import Packer, joined
from engine.export.player.moving_rows import NamedRows
from engine.export.player.page import page_writer
from engine.raster.rasterize import rasterize
from tests.browser import AS_A_CARD, AS_A_CARD_WITH_WEBGPU, WEBGPU_FLAGS, WITHOUT_WEBGPU, Browser, chromium
from tests.player_scenes import (
    BACKGROUND,
    LENGTHS,
    N_FRAMES,
    NEAR,
    SIZE,
    camera,
    header,
    moving,
    places,
    still,
    write_page,
)

pytestmark = [
    pytest.mark.e2e,
    pytest.mark.slow,
    pytest.mark.skipif(chromium() is None, reason="Chromium is not installed: apt-get install -y chromium"),
]

SHIFT, CTRL = 8, 2
LEAST_PSNR = 35.0
LEAST_PSNR_OF_WAYS = 45.0
"""Of pictures that are drawn otherwise than by WebGL, against it."""
SCALE = 3
"""Pictures are drawn so many times as large as the cameras' own."""
PICTURE = (SCALE * SIZE[0], SCALE * SIZE[1])
SETTLED = (
    "(p => p && p.isDrawn && p.renderer.isDone() && p.share === 1 && p.onScreen === p.clock.frame && !p.pictures.isBusy"
    " && p.pictures.answered === p.pictures.wish.key)(window.clipgstreamPlayer)"
)
EVIL = "</script><img src=x onerror=\"document.title='pwned'\">"


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_page(tmp_path_factory.mktemp("player") / "scene.html", header())


@pytest.fixture(scope="module", params=["processor", "card"])
def shared_browser(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """Where the worker paints pictures, as it does without a graphics card, and where WebGL draws them."""
    with Browser(tmp_path_factory.mktemp("browser")) as browser:
        if request.param == "card":
            browser.before_pages(AS_A_CARD + WITHOUT_WEBGPU)
        yield browser


@pytest.fixture
def browser(shared_browser: Browser, page: Path) -> Iterator[Browser]:
    """The page, opened; afterwards nobody has complained about it, and nothing was asked of a network."""
    show(shared_browser, page)
    yield shared_browser
    assert shared_browser.console == []
    assert all(url.startswith(("file:", "blob:")) for url in shared_browser.requests)


def show(browser: Browser, page: Path, *, until: str = SETTLED) -> None:
    """Open a page in a window in which a picture of PICTURE fits exactly."""
    browser.console.clear()
    browser.requests.clear()
    browser.resize(PICTURE[0], 800)
    browser.open(page)
    browser.wait("document.readyState === 'complete'")
    browser.wait(until)
    fit(browser)


def fit(browser: Browser, *, ratio: float = 1.0) -> None:
    """Make the canvas as large as PICTURE, in the page's pixels."""
    bar = browser.value("document.querySelector('footer').offsetHeight")
    browser.resize(PICTURE[0], PICTURE[1] + bar, ratio=ratio)
    browser.wait(f"document.getElementById('picture').clientHeight === {PICTURE[1]}")
    browser.value("void clipgstreamPlayer.changed()")  # another ratio alone is not always observed
    browser.wait(f"clipgstreamPlayer.canvas.height === {ratio * PICTURE[1]}")
    browser.value("void (document.querySelector('header').hidden = true)")  # it lies over the picture


def drawn(browser: Browser, *, ratio: int = 1) -> np.ndarray:
    """The canvas as it is seen. [H, W, 3] in 0..1"""
    browser.wait(SETTLED)
    browser.value("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return browser.picture()[: ratio * PICTURE[1]] / 255.0


def expected(frame: int, view: int, *, ratio: int = 1) -> np.ndarray:
    """The same by the rasterizer."""
    clip, in_clip = places()[frame]
    size = (ratio * PICTURE[0], ratio * PICTURE[1])
    matrix, K = camera(view, size=size)
    rendering = rasterize(
        joined(still(clip, in_clip), moving(clip, in_clip)).gaussians(),
        torch.tensor(matrix[None], dtype=torch.float32),
        torch.tensor(K[None], dtype=torch.float32),
        *size,
        backend=backend_called("cpu"),
        near_plane=NEAR,
        background=torch.tensor(BACKGROUND),
    )
    return rendering.image[0].clamp(0.0, 1.0).numpy()


def psnr(some: np.ndarray, others: np.ndarray) -> float:
    return float(-10.0 * np.log10(np.mean((some - others) ** 2) + 1e-12))


def label(browser: Browser) -> str:
    return browser.value("document.getElementById('time').textContent")


def state(browser: Browser, expression: str) -> Any:
    return browser.value(f"clipgstreamPlayer.{expression}")


def test_pictures_are_those_of_the_rasterizer(browser: Browser):
    for frame, view in ((0, 0), (4, 1), (6, 2), (8, 3), (N_FRAMES - 1, 4)):
        browser.value(f"void clipgstreamPlayer.go({frame}); void clipgstreamPlayer.look({view})")
        found = drawn(browser)
        assert state(browser, "renderer.painted !== null") == state(browser, "renderer.isSoftware")
        assert label(browser).startswith(f"Frame {frame} of {N_FRAMES - 1} ")
        assert psnr(found, expected(frame, view)) > LEAST_PSNR
        for other in {(frame + 1) % N_FRAMES, (frame + 3) % N_FRAMES}:
            assert psnr(found, expected(other, view)) < LEAST_PSNR - 5.0  # so the figure can tell frames apart


def test_all_ways_of_drawing_make_the_same_picture(page: Path, tmp_path: Path):
    pictures = {}
    ways = {"WebGL": AS_A_CARD + WITHOUT_WEBGPU, "WebGPU": AS_A_CARD_WITH_WEBGPU, "painted": ""}
    for way, script in ways.items():
        (tmp_path / way).mkdir()
        with Browser(tmp_path / way, flags=WEBGPU_FLAGS) as browser:
            browser.before_pages(script)
            show(browser, page)
            if way == "WebGPU" and not browser.value("navigator.gpu && navigator.gpu.requestAdapter().then(Boolean)"):
                continue  # an older browser
            drawer = "GpuRenderer" if way == "WebGPU" else "Renderer"
            assert state(browser, "renderer.constructor.name") == drawer
            for view in range(3):
                browser.value(f"void clipgstreamPlayer.go({3 * view}); void clipgstreamPlayer.look({view})")
                pictures[way, view] = drawn(browser)
            browser.value("void (clipgstreamPlayer.pictures.quality = 'low'); void clipgstreamPlayer.changed()")
            pictures[way, "low"] = drawn(browser)
            assert psnr(pictures[way, "low"], pictures[way, 2]) < LEAST_PSNR
            assert bool(state(browser, "renderer.painted instanceof WebGLTexture")) == (way == "painted")
            assert browser.console == []
    assert ("painted", 2) in pictures
    for (way, view), picture in pictures.items():
        assert psnr(picture, pictures["WebGL", view]) > LEAST_PSNR_OF_WAYS, way


def test_a_screen_with_small_pixels_is_used_in_full(browser: Browser):
    fit(browser, ratio=2.0)
    browser.key("1")
    browser.wait(f"clipgstreamPlayer.canvas.width === {2 * PICTURE[0]}")
    assert psnr(drawn(browser, ratio=2), expected(0, 0, ratio=2)) > LEAST_PSNR
    fit(browser)
    browser.key("1")
    browser.wait(f"clipgstreamPlayer.canvas.width === {PICTURE[0]}")
    assert psnr(drawn(browser), expected(0, 0)) > LEAST_PSNR


def test_the_label_never_names_another_frame_than_the_picture(browser: Browser):
    """Scrubbing faster than frames are made: whenever something was drawn, the worker's frame and the label agree."""
    browser.value(
        """(() => {
          const player = clipgstreamPlayer, renderer = player.renderer, tell = player.tell.bind(player);
          const take = renderer.take.bind(renderer), draw = renderer.draw.bind(renderer);
          window.seen = [];
          let held = player.shown, isDrawn = false;
          renderer.take = (answer) => { take(answer); held = answer.frame; };
          renderer.draw = (...args) => { draw(...args); isDrawn = true; };
          player.tell = () => {
            tell();
            const words = document.getElementById("time").textContent;
            if (isDrawn) seen.push([held, Number(words.split(" ")[1]), player.clock.frame]);
            isDrawn = false;
          };
        })()"""
    )
    box = browser.value("(({x, y, width}) => [x, y, width])(document.getElementById('scrub').getBoundingClientRect())")
    held = {"button": "left", "buttons": 1, "clickCount": 1}
    browser.mouse("mousePressed", box[0] + 1, box[1] + 10, **held)
    for step in range(60):
        browser.mouse("mouseMoved", box[0] + (step * 37 % 100) / 100 * box[2], box[1] + 10, **held)
    browser.mouse("mouseMoved", box[0] + 0.99 * box[2], box[1] + 10, **held)
    browser.mouse("mouseReleased", box[0] + 0.99 * box[2], box[1] + 10, **held)
    browser.wait(SETTLED)
    seen = browser.value("seen")
    assert len({frame for frame, _, _ in seen}) > 1
    assert all(told == frame for frame, told, _ in seen)
    assert seen[-1][0] == int(0.99 * N_FRAMES)


def test_keys(browser: Browser):
    for key, modifiers, frame in (
        ("ArrowRight", 0, 1),
        (".", 0, 2),
        ("ArrowLeft", 0, 1),
        (",", 0, 0),
        ("ArrowLeft", 0, 0),
        ("End", 0, N_FRAMES - 1),
        ("ArrowRight", 0, N_FRAMES - 1),
        ("ArrowUp", 0, sum(LENGTHS[:3])),
        ("ArrowUp", 0, sum(LENGTHS[:2])),
        ("ArrowDown", 0, sum(LENGTHS[:3])),
        ("Home", 0, 0),
        ("ArrowRight", SHIFT, N_FRAMES - 1),  # a second is longer than the scene
        ("ArrowLeft", SHIFT, 0),
    ):
        browser.key(key, modifiers=modifiers)
        browser.wait(SETTLED)
        assert label(browser).startswith(f"Frame {frame} of"), key
    browser.key("3")
    assert state(browser, "view.camera") == 2
    browser.key("]")
    assert state(browser, "view.camera") == 3
    browser.key("[")
    browser.key("f")
    assert state(browser, "view.camera") is None
    browser.key("9")  # there is none
    assert state(browser, "view.camera") is None
    browser.key(">", modifiers=SHIFT)
    assert state(browser, "clock.speed") == 2
    browser.key("/", modifiers=CTRL)
    assert state(browser, "clock.isLooping") is False
    browser.key("?", modifiers=SHIFT)
    assert browser.value("document.getElementById('keys').open")
    rows = browser.value("[...document.querySelectorAll('#key-table tr')].map(row => row.innerText)")
    assert any("Play or pause" in row for row in rows)
    browser.key("Escape", code="Escape")
    browser.value("void document.getElementById('keys').close()")


def test_playing_goes_on_round_and_stops_at_the_end_without_a_loop(browser: Browser):
    browser.value("void (clipgstreamPlayer.clock.speed = 4)")
    browser.key(" ", text=" ", code="Space")
    assert state(browser, "clock.isPlaying")
    browser.value("window.seen = new Set()")
    browser.wait("seen.add(clipgstreamPlayer.shown).size >= 4")
    browser.key(" ", text=" ", code="Space")
    assert not state(browser, "clock.isPlaying")
    browser.value("void clipgstreamPlayer.loop(false)")
    browser.key(" ", text=" ", code="Space")
    browser.wait("!clipgstreamPlayer.clock.isPlaying")
    browser.wait(SETTLED)
    assert state(browser, "shown") == N_FRAMES - 1


def test_pointer_and_fingers_move_the_view(browser: Browser):
    x, y = PICTURE[0] / 2, PICTURE[1] / 2
    before = drawn(browser)
    yaw, pitch = state(browser, "view.yaw"), state(browser, "view.pitch")
    browser.drag((x, y), (x + 100, y - 20))
    assert state(browser, "view.yaw") == pytest.approx(yaw + 0.6)
    assert state(browser, "view.pitch") == pytest.approx(pitch - 0.12)
    assert psnr(drawn(browser), before) < 30.0
    pivot, distance = state(browser, "view.pivot"), state(browser, "view.distance")
    browser.drag((x, y), (x + 60, y), button="right")
    moved = np.linalg.norm(np.subtract(state(browser, "view.pivot"), pivot))
    assert moved == pytest.approx(60 * distance / (PICTURE[1] / (2 * np.tan(0.4))), rel=1e-6)
    browser.mouse("mouseWheel", x, y, deltaX=0, deltaY=-200)
    browser.wait(f"clipgstreamPlayer.view.distance < {0.8 * distance}")
    browser.call("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=2)
    yaw, distance = state(browser, "view.yaw"), state(browser, "view.distance")
    browser.touch([(x, y), (x + 30, y), (x + 50, y)])
    assert state(browser, "view.yaw") == pytest.approx(yaw + 0.3)
    browser.touch([(x - 40, y), (x - 60, y), (x - 80, y)], [(x + 40, y), (x + 60, y), (x + 80, y)])
    assert state(browser, "view.distance") == pytest.approx(distance / 2.0)
    pivot, (width, height) = (
        state(browser, "view.pivot"),
        browser.value("(({width, height}) => [width, height])(clipgstreamPlayer.canvas.getBoundingClientRect())"),
    )
    now_s = time.time()
    for at_s in (now_s, now_s + 0.2):
        browser.touch([(x + 90, y - 30)], at_s=at_s)
    moved = np.linalg.norm(np.subtract(state(browser, "view.pivot"), pivot))
    unit = state(browser, f"view.distance / clipgstreamPlayer.view.focal({width}, {height})")
    assert moved == pytest.approx(unit * np.hypot(x + 90 - width / 2, y - 30 - height / 2), rel=1e-3)
    pivot = state(browser, "view.pivot")
    browser.touch([(x, y - 80)])  # a third tap is a first one again
    assert state(browser, "view.pivot") == pivot
    browser.call("Emulation.setTouchEmulationEnabled", enabled=False)
    browser.key("f")
    assert psnr(drawn(browser), before) > 60.0


def test_what_was_drawn_comes_back_after_the_context_was_lost(browser: Browser):
    browser.key("End")
    before = drawn(browser)
    browser.value("void (window.loss = clipgstreamPlayer.renderer.gl.getExtension('WEBGL_lose_context')).loseContext()")
    browser.wait("clipgstreamPlayer.isLost")
    browser.key("Home")
    browser.key("End")
    browser.value("void loss.restoreContext()")
    browser.wait("!clipgstreamPlayer.isLost")
    assert psnr(drawn(browser), before) > 60.0
    browser.console[:] = [said for said in browser.console if "CONTEXT_LOST" not in said and "context lost" not in said]


def test_a_single_frame_of_nothing_is_the_background(shared_browser: Browser, tmp_path: Path):
    packer, about = Packer(), header()
    nothing = still(0, 0)[:0]
    block = packer.clip(1, lambda frame: nothing, lambda frame: NamedRows(nothing))
    assert packer.shared is not None
    about["shared"] = packer.shared.description
    about["clips"].append({"clip_index": 0, "name": "one", "first": 0, "frame_index": 0, **block.description})
    page = tmp_path / "nothing.html"
    with page.open("w", encoding="utf-8") as stream, page_writer(stream, about) as writer:
        writer.block("one", block)
        writer.block("shared", packer.shared)
    show(shared_browser, page)
    shared_browser.key(" ", text=" ", code="Space")
    assert np.abs(drawn(shared_browser) - np.array(BACKGROUND)).max() < 1.5 / 255
    assert not state(shared_browser, "clock.isPlaying")
    assert shared_browser.console == []


def test_names_are_shown_as_they_are(shared_browser: Browser, tmp_path: Path):
    page = write_page(tmp_path / "evil.html", header(title=EVIL, names=[EVIL] * 5))
    show(shared_browser, page)
    assert shared_browser.value("document.title") == EVIL
    assert shared_browser.value("document.getElementById('title').textContent") == EVIL
    assert shared_browser.value("document.getElementById('camera').options[1].text") == EVIL
    assert shared_browser.value("document.images.length") == 0
    assert shared_browser.console == []


def test_a_page_with_a_folder_loads_clips_as_they_are_needed(shared_browser: Browser, tmp_path: Path):
    folder = tmp_path / "scene #1 <b>"
    page = write_page(tmp_path / "scene.html", header(), folder=folder)
    (folder / "clip2.js").write_text("nonsense(")
    (folder / "clip3.js").unlink()
    show(shared_browser, page)
    shared_browser.wait("clipgstreamPlayer.pictures.loaded.size === 2")  # the first one and the next
    shared_browser.key("1")
    assert psnr(drawn(shared_browser), expected(0, 0)) > LEAST_PSNR
    assert shared_browser.console == []
    for first, name in ((7, "clip2"), (10, "clip3")):
        shared_browser.value(f"void clipgstreamPlayer.go({first})")
        shared_browser.wait("!document.getElementById('notice').hidden")
        shared_browser.wait(f"document.getElementById('notice').textContent.includes('{name}.js cannot be read')")
        assert label(shared_browser).startswith("Frame 0 of")  # what is still on the screen
    shared_browser.value("void clipgstreamPlayer.go(0)")
    shared_browser.wait("document.getElementById('notice').hidden")


def test_a_damaged_clip_is_said(shared_browser: Browser, tmp_path: Path):
    page = write_page(tmp_path / "scene.html", header())
    text = page.read_text(encoding="utf-8")
    at = text.index('id="block-clip0">') + 40
    page.write_text(text[:at] + "AAAA" + text[at + 4 :], encoding="utf-8")
    shared_browser.console.clear()
    shared_browser.open(page)
    shared_browser.wait("document.getElementById('notice')?.textContent.startsWith('A clip is damaged')")
    assert shared_browser.value("clipgstreamPlayer.onScreen === null"), "nothing of a damaged clip is drawn"


@pytest.mark.parametrize(
    ("without", "said"),
    [
        ("delete window.DecompressionStream", "DecompressionStream"),
        ("HTMLCanvasElement.prototype.getContext = () => null", "WebGL 2"),
    ],
)
def test_an_old_browser_is_told_what_it_lacks(tmp_path: Path, page: Path, without: str, said: str):
    with Browser(tmp_path) as browser:
        browser.before_pages(without)
        browser.open(page)
        browser.wait(f"document.getElementById('notice')?.textContent.includes('{said}')")
        assert browser.console == []
