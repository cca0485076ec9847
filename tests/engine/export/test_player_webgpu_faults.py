"""The player where WebGPU fails, by faults that are put into a real browser: the page goes on without it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.browser import AS_A_CARD_WITH_WEBGPU, WEBGPU_FLAGS, Browser, chromium
from tests.engine.export.test_player_chromium import LEAST_PSNR, SETTLED, drawn, expected, fit, psnr, state
from tests.player_scenes import header, write_page

pytestmark = [
    pytest.mark.e2e,
    pytest.mark.slow,
    pytest.mark.skipif(chromium() is None, reason="Chromium is not installed: apt-get install -y chromium"),
]

SAID = "WebGPU has failed in this browser, so the page draws with WebGL 2."
PATCH = """(() => {{
  const type = {type}.prototype, before = type.{name};
  type.{name} = function (...given) {{ {does} }};
}})();"""
AT_THE_START = {
    "a shader that does not compile": ("GPUDevice", "createShaderModule", "return before.call(this, {code: 'no'});"),
    "a pipeline that throws": ("GPUDevice", "createComputePipeline", "throw new TypeError('No pipeline.');"),
    "a buffer that is refused": (
        "GPUDevice",
        "createBuffer",
        "return before.call(this, {...given[0], size: 2 ** 40});",
    ),
    "no canvas": ("GPUCanvasContext", "configure", "throw new Error('No canvas.');"),
    "a device that does not come": ("GPUAdapter", "requestDevice", "return new Promise(() => {});"),
    "a device that is refused": ("GPUAdapter", "requestDevice", "throw new Error('No device.');"),
}
LATER = {
    "a device that goes away": "clipgstreamPlayer.device.destroy()",
    "an error of validation": "clipgstreamPlayer.renderer.rows.destroy(); clipgstreamPlayer.changed()",
    "memory that is used up": (
        "clipgstreamPlayer.device.dispatchEvent(new GPUUncapturedErrorEvent('uncapturederror',"
        " {error: new GPUOutOfMemoryError('All of it.'), cancelable: true}))"
    ),
    "a draw that throws": (
        "clipgstreamPlayer.renderer.context.getCurrentTexture = () => { throw new Error('No texture.'); };"
        "clipgstreamPlayer.changed()"
    ),
}


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_page(tmp_path_factory.mktemp("player") / "scene.html", header())


def opened(folder: Path, page: Path, script: str = "", *, fragment: str = "") -> Browser:
    browser = Browser(folder, flags=WEBGPU_FLAGS)
    browser.before_pages(AS_A_CARD_WITH_WEBGPU + script)
    browser.resize(480, 800)
    browser.call("Page.navigate", url=page.as_uri() + fragment)
    browser.wait(SETTLED)
    return browser


def assert_goes_on(browser: Browser, *, frame: int, view: int) -> None:
    """Without WebGPU, at this frame through this camera, with one sentence and one warning."""
    browser.wait(f"clipgstreamPlayer.renderer.constructor.name === 'Renderer' && {SETTLED}")
    assert browser.value("document.querySelectorAll('canvas').length") == 1
    assert browser.value("clipgstreamPlayer.canvas === document.getElementById('picture')")
    assert state(browser, "onScreen") == frame
    assert state(browser, "view.camera") == view
    browser.value("void (document.getElementById('notice').style.visibility = 'hidden')")  # it lies over the picture
    fit(browser)
    assert psnr(drawn(browser), expected(frame, view)) > LEAST_PSNR


@pytest.mark.parametrize("fault", AT_THE_START)
def test_a_page_begins_without_webgpu_where_that_fails(tmp_path: Path, page: Path, fault: str):
    kind, name, does = AT_THE_START[fault]
    script = PATCH.format(type=kind, name=name, does=does)
    with opened(tmp_path, page, script, fragment="#t=0.2&camera=b") as browser:
        if not browser.value("navigator.gpu && navigator.gpu.requestAdapter().then(Boolean)"):
            pytest.skip("an older browser")
        is_said = browser.value("!document.getElementById('notice').hidden")
        assert is_said == (kind != "GPUAdapter")
        assert not is_said or browser.value("document.getElementById('words').textContent") == SAID
        assert_goes_on(browser, frame=5, view=1)
        assert len(browser.console) == is_said, browser.console


@pytest.mark.parametrize("fault", LATER)
def test_a_page_goes_on_without_webgpu_after_that_has_failed(tmp_path: Path, page: Path, fault: str):
    with opened(tmp_path, page) as browser:
        if state(browser, "device === null"):
            pytest.skip("an older browser")
        browser.value("void clipgstreamPlayer.go(5); void clipgstreamPlayer.look(1)")
        browser.wait(SETTLED)
        browser.value("void clipgstreamPlayer.canvas.focus()")
        browser.value(f"void (() => {{ {LATER[fault]}; }})()")
        browser.wait("!document.getElementById('notice').hidden")
        assert browser.value("document.getElementById('words').textContent") == SAID
        assert_goes_on(browser, frame=5, view=1)
        assert browser.value("document.activeElement.id") == "picture"
        x, y, yaw = 240, 200, state(browser, "view.yaw")
        browser.drag((x, y), (x + 50, y))
        assert state(browser, "view.camera") is None
        assert state(browser, "view.yaw") != yaw
        assert len(browser.console) == 1, browser.console
