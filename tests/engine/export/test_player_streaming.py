"""The player on a server: what it asks for and in which order, what it does where that fails, what its policy forbids,
and how it is used within another page and without a pointer."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.browser import AS_A_CARD, WITHOUT_WEBGPU, Browser, chromium
from tests.engine.export.test_player_chromium import LEAST_PSNR, SETTLED, drawn, expected, fit, label, psnr
from tests.player_scenes import LENGTHS, N_FRAMES, header, write_page
from tests.range_server import RangeServer

pytestmark = [
    pytest.mark.e2e,
    pytest.mark.slow,
    pytest.mark.skipif(chromium() is None, reason="Chromium is not installed: apt-get install -y chromium"),
]

POSTER = bytes.fromhex(  # one grey pixel
    "ffd8ffe000104a46494600010100000100010000ffdb004300ffffffffffffffffffffffffffffffffffffffffffffffffffffffffffff"
    "ffffffffffffffffffffffffffffffffffffffffffffffffffffffffffffffffffffffc0000b080001000101011100ffc400140001"
    "0000000000000000000000000000000000ffc40014100100000000000000000000000000000000ffda0008010100003f0037ffd9"
)
NOTE_WHAT_IS_SAID = """new MutationObserver(() => {
  const [words, status] = ["words", "status"].map((id) => document.getElementById(id)?.textContent);
  if (words && words !== said.at(-1)?.[0]) said.push([words, status]);
}).observe(document, { childList: true, characterData: true, subtree: true });
window.said = [];"""
"""A script before the page's own, for words that may be gone before anybody looks."""
FULL = f"{SETTLED} && [...clipgstreamPlayer.pictures.loaded.values()].every(n => n === 3)"


@pytest.fixture(scope="module")
def shared_browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("browser")) as browser:
        browser.call("Network.setCacheDisabled", cacheDisabled=True)
        yield browser


@pytest.fixture
def browser(shared_browser: Browser) -> Browser:
    shared_browser.console.clear()
    shared_browser.requests.clear()
    shared_browser.resize(480, 800)
    return shared_browser


@pytest.fixture
def server(browser: Browser, tmp_path: Path) -> Iterator[RangeServer]:
    """Serves the page of the made scene with its folder."""
    write_page(tmp_path / "scene.html", header(), folder=tmp_path / "scene_data", poster=POSTER)
    with RangeServer(tmp_path) as server:
        yield server


def go_to(browser: Browser, url: str, *, until: str = FULL) -> None:
    browser.call("Page.navigate", url="about:blank")
    browser.call("Page.navigate", url=url)
    browser.wait("document.readyState === 'complete'")
    browser.wait(until)


@contextmanager
def before_pages(browser: Browser, script: str) -> Iterator[None]:
    """Run a script before those of pages that are opened meanwhile."""
    number = browser.before_pages(script)
    try:
        yield
    finally:
        browser.call("Page.removeScriptToEvaluateOnNewDocument", identifier=number)


def asked(server: RangeServer, name: str) -> list[str]:
    return [wanted for file, wanted in server.asked if file == name]


def words(browser: Browser) -> str:
    return browser.value("document.getElementById('words').textContent")


def state(browser: Browser, expression: str) -> Any:
    return browser.value(f"clipgstreamPlayer.{expression}")


def test_a_coarse_picture_comes_first_and_then_the_rest_of_it(browser: Browser, server: RangeServer):
    go_to(browser, server.url("scene.html"))
    parts = {name: state(browser, f"header.{name}.parts") for name in ("shared", "clips[0]")}
    first, rest = parts["shared"][0][0], sum(size for size, _ in parts["shared"])
    assert [name for name, _ in server.asked[1:5]].count("shared.bin") == 2
    assert asked(server, "shared.bin") == [f"bytes=0-{first - 1}", f"bytes={first}-{rest - 1}"]
    assert asked(server, "clip0.bin")[0] == f"bytes=0-{parts['clips[0]'][0][0] - 1}"
    assert (
        max(
            map(
                server.asked.index,
                [("shared.bin", asked(server, "shared.bin")[0]), ("clip0.bin", asked(server, "clip0.bin")[0])],
            )
        )
        == 2
    )
    assert not [url for url in browser.requests if url.endswith(".js")]
    assert browser.value("document.getElementById('poster')") is None
    fit(browser)
    browser.key("1")
    assert psnr(drawn(browser), expected(0, 0)) > LEAST_PSNR
    browser.value(f"void clipgstreamPlayer.go({N_FRAMES - 1}); void clipgstreamPlayer.look(2)")
    browser.wait(FULL)
    assert psnr(drawn(browser), expected(N_FRAMES - 1, 2)) > LEAST_PSNR
    assert browser.console == []


def test_the_quality_says_how_much_is_drawn(browser: Browser, server: RangeServer):
    with before_pages(browser, AS_A_CARD + WITHOUT_WEBGPU):  # else it is painted, and how much of it is not counted
        go_to(browser, server.url("scene.html"))
    n = state(browser, "renderer.nDrawn")
    assert n > 0
    for quality, share in (("low", 0.5), ("full", 1.0), ("auto", 1.0)):
        browser.value(
            f"void (q => {{ q.value = '{quality}'; q.dispatchEvent(new Event('change')); }})"
            "(document.getElementById('quality'))"
        )
        browser.wait(f"clipgstreamPlayer.pictures.quality === '{quality}' && {SETTLED}")
        assert state(browser, "renderer.nDrawn") == pytest.approx(share * n, rel=0.02)
    assert browser.console == []


@pytest.mark.parametrize("piece_bytes", [None, 500])
def test_a_server_without_ranges_sends_whole_files(browser: Browser, server: RangeServer, piece_bytes: int | None):
    server.has_ranges, server.piece_bytes = False, piece_bytes
    go_to(browser, server.url("scene.html"))
    fit(browser)
    browser.value("void clipgstreamPlayer.go(4); void clipgstreamPlayer.look(1)")
    browser.wait(FULL)
    assert psnr(drawn(browser), expected(4, 1)) > LEAST_PSNR
    assert browser.console == []


def test_what_fails_is_tried_again_and_said(browser: Browser, server: RangeServer):
    server.failing["clip0.bin"] = 2
    with before_pages(browser, NOTE_WHAT_IS_SAID):
        go_to(browser, server.url("scene.html"))
    said = browser.value("said")
    assert "scene_data/clip0.bin cannot be read (HTTP 503). Trying again \u2026" in [words for words, _ in said]
    assert all(words == status for words, status in said)
    assert browser.value("document.getElementById('notice').hidden")
    assert len(asked(server, "clip0.bin")) >= 4


def test_what_is_missing_is_said_until_it_is_there(browser: Browser, server: RangeServer):
    path = server.folder / "scene_data" / "clip2.bin"
    data = path.read_bytes()
    path.unlink()
    go_to(browser, server.url("scene.html"))
    browser.value(f"void clipgstreamPlayer.go({sum(LENGTHS[:2])})")
    browser.wait("document.getElementById('words').textContent.includes('clip2.bin cannot be read (HTTP 404).')")
    assert label(browser).startswith("Frame 0 of")
    n = len(asked(server, "clip2.bin"))
    path.write_bytes(data[: len(data) // 2])  # cut off
    browser.value("document.getElementById('again').click()")
    browser.wait("document.getElementById('words').textContent.includes('clip2.bin')")
    path.write_bytes(data)
    browser.wait(f"clipgstreamPlayer.pictures.loader.failure(2)?.isFinal || {FULL}")
    browser.value("clipgstreamPlayer.pictures.loader.again()")
    browser.wait(FULL)
    assert label(browser).startswith(f"Frame {sum(LENGTHS[:2])} of")
    assert len(asked(server, "clip2.bin")) > n


def test_a_damaged_clip_is_asked_for_again(browser: Browser, server: RangeServer):
    path = server.folder / "scene_data" / "clip1.bin"
    data = path.read_bytes()
    go_to(browser, server.url("scene.html"), until="window.clipgstreamPlayer?.header")
    first = state(browser, "header.clips[1].parts[0][0]")
    path.write_bytes(data[: first + 2] + b"\xff" * (len(data) - first - 2))  # all but what comes first
    go_to(browser, server.url("scene.html"), until=SETTLED)
    browser.value(f"void clipgstreamPlayer.go({LENGTHS[0]})")
    browser.wait("document.getElementById('words').textContent.startsWith('A clip is damaged')")
    path.write_bytes(data)
    browser.value("document.getElementById('again').click()")
    browser.wait(FULL)
    assert browser.value("document.getElementById('notice').hidden")
    assert label(browser).startswith(f"Frame {LENGTHS[0]} of")
    assert browser.console == []


def test_lengths_that_lie_are_found_before_memory_is_taken(browser: Browser, server: RangeServer):
    page = server.folder / "scene.html"
    text = page.read_text(encoding="utf-8")
    at = text.index('"parts":[[', text.index('"name":"clip0"')) + len('"parts":[[')
    sizes = text[at : text.index("]", at)]
    packed, n_bytes = sizes.split(",")
    page.write_text(text[:at] + f"{packed},{int(n_bytes) // 2}" + text[at + len(sizes) :], encoding="utf-8")
    go_to(
        browser,
        server.url("scene.html"),
        until="document.getElementById('words').textContent.startsWith('A clip is damaged')",
    )
    assert "has more than the" in words(browser)


def test_a_leap_outranks_what_was_needed_before(browser: Browser, server: RangeServer):
    server.held["clip1.bin"] = threading.Event()
    go_to(browser, server.url("scene.html"), until=SETTLED)
    browser.wait("clipgstreamPlayer.pictures.loader.running.has(1)")
    browser.value(f"void clipgstreamPlayer.go({N_FRAMES - 1})")
    browser.wait(SETTLED)
    assert label(browser).startswith(f"Frame {N_FRAMES - 1} of")
    assert not state(browser, "pictures.loaded.has(1)")


def test_clips_that_fail_are_in_nobodys_way(browser: Browser, server: RangeServer):
    server.failing.update({"clip1.bin": 99, "clip2.bin": 99})
    go_to(browser, server.url("scene.html"), until=SETTLED)
    browser.value(  # what fails is tried again, but not within anybody's patience
        "const { loader } = clipgstreamPlayer.pictures;"
        "const againMs = performance.now() + 1e9;"
        "loader.fail = (key) => loader.failures.set(key, { tries: 1, isFinal: false, againMs });"
        "loader.again()"
    )
    browser.wait("clipgstreamPlayer.pictures.loader.failures.size === 2")
    browser.wait("clipgstreamPlayer.pictures.loaded.has(3)")
    assert not browser.value("[1, 2].some((clip) => clipgstreamPlayer.pictures.loaded.has(clip))"), "both still wait"


@pytest.mark.parametrize("is_final", ["true", "false"])
def test_a_clip_that_failed_is_asked_for_as_soon_as_it_is_wanted(browser: Browser, server: RangeServer, is_final: str):
    server.failing["clip3.bin"] = 99
    go_to(browser, server.url("scene.html"), until=SETTLED)
    browser.wait("clipgstreamPlayer.pictures.loader.failure(3)")
    browser.value(
        "void Object.assign(clipgstreamPlayer.pictures.loader.failure(3),"
        f" {{isFinal: {is_final}, againMs: performance.now() + 1e9}})"
    )
    del server.failing["clip3.bin"]
    browser.value(f"void clipgstreamPlayer.go({N_FRAMES - 1})")
    browser.wait(SETTLED)
    assert label(browser).startswith(f"Frame {N_FRAMES - 1} of")
    assert browser.value("document.getElementById('notice').hidden")


def test_memory_is_bounded_while_one_scrubs(browser: Browser, server: RangeServer):
    page = server.folder / "scene.html"
    page.write_text(
        page.read_text(encoding="utf-8").replace("CLIPS_BYTES = 192 << 20", "CLIPS_BYTES = 1"), encoding="utf-8"
    )
    go_to(browser, server.url("scene.html"), until=SETTLED)
    for frame in (N_FRAMES - 1, 0, 4, 8, 0, N_FRAMES - 1):
        browser.value(f"void clipgstreamPlayer.go({frame})")
        browser.wait(SETTLED)
        assert label(browser).startswith(f"Frame {frame} of")
        assert state(browser, "pictures.loaded.size") <= 2
    assert browser.console == []


def test_the_policy_lets_nothing_else_run_or_be_asked(browser: Browser, server: RangeServer):
    go_to(browser, server.url("scene.html"))
    assert browser.console == []
    (server.folder / "evil.js").write_text("window.evil = 'script'")
    browser.value(
        """(async () => {
          window.refused = [];
          addEventListener("securitypolicyviolation", (event) => refused.push(event.effectiveDirective));
          const put = (name, given) => document.body.append(Object.assign(document.createElement(name), given));
          put("script", { textContent: "window.evil = 'inline'" });
          put("script", { src: "evil.js" });
          put("img", { src: "evil.png" });
          put("iframe", { src: "scene.html" });
          document.body.setAttribute("onclick", "window.evil = 'handler'");
          document.body.click();
          setTimeout(() => new Function("window.evil = 'eval'")()); // the protocol itself may evaluate
          await fetch("http://localhost:1/").catch(() => {});
        })()"""
    )
    kinds = {"script-src-elem", "script-src-attr", "script-src", "img-src", "frame-src", "connect-src"}
    browser.wait(f"new Set(refused).size >= {len(kinds)}")
    assert set(browser.value("refused")) == kinds
    assert browser.value("window.evil") is None


def test_the_address_and_the_page_around_it_say_what_plays(browser: Browser, server: RangeServer):
    (server.folder / "around.html").write_text(
        '<iframe src="scene.html#t=0.2&camera=c" width="480" height="400" allow="fullscreen"></iframe>'
    )
    inner = "frames[0].clipgstreamPlayer"
    go_to(browser, server.url("around.html"), until=f"{inner}?.onScreen === 5")
    assert browser.value(f"{inner}.view.camera") == 2
    for said, then in (
        ({"clipgstream": "seek", "t": 0.4}, f"{inner}.clock.frame === 10"),
        ({"clipgstream": "play"}, f"{inner}.clock.isPlaying"),
        ({"clipgstream": "pause"}, f"!{inner}.clock.isPlaying"),
    ):
        browser.value(f"frames[0].postMessage({said}, '*')".replace("'", '"'))
        browser.wait(then)
    browser.value(f"{inner}.go(3)")
    for wrong in (
        "null",
        "'play'",
        "{clipgstream: 'seek', t: 'x'}",
        "{clipgstream: 'play', more: 1}",
        "{clipgstream: 'seek'}",
    ):
        browser.value(f"frames[0].postMessage({wrong}, '*')")
    browser.value(f"frames[0].eval && {inner}.canvas.ownerDocument.defaultView.postMessage(null, '*')")
    browser.value("new Promise(done => setTimeout(done, 200))")
    assert not browser.value(f"{inner}.clock.isPlaying")
    assert browser.value(f"{inner}.clock.frame") == 3


def test_who_wants_less_motion_starts_the_playing_himself(browser: Browser, server: RangeServer):
    browser.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-reduced-motion", "value": "reduce"}])
    go_to(browser, server.url("scene.html") + "#autoplay")
    assert not state(browser, "clock.isPlaying")
    browser.call("Emulation.setEmulatedMedia", features=[])
    go_to(browser, server.url("scene.html") + "#autoplay", until="window.clipgstreamPlayer?.clock.isPlaying")
    assert state(browser, "clock.isPlaying")


def test_every_control_is_reached_and_seen_by_tab(browser: Browser, server: RangeServer):
    browser.resize(1000, 700)
    go_to(browser, server.url("scene.html"))
    reached = []
    for _ in ORDER:
        browser.key("Tab", code="Tab")
        reached.append(
            browser.value(
                """(element => { const style = getComputedStyle(element), name = element.getAttribute("aria-label")
                  || element.textContent.trim() || element.closest("label")?.textContent.trim();
                  return [element.id, Boolean(name), style.outlineStyle !== "none" || style.boxShadow !== "none"];
                })(document.activeElement)"""
            )
        )
    ids = [one for one, _, _ in reached]
    assert [name for name in ids if name in ORDER] == ORDER
    assert all(has_name and is_seen for name, has_name, is_seen in reached if name in ORDER)
    browser.value("document.getElementById('scrub').focus()")
    browser.key("ArrowRight")
    browser.wait(SETTLED)
    slider = "(name => document.getElementById('scrub').getAttribute(name))"
    assert browser.value(f"{slider}('aria-valuenow')") == "1"
    assert browser.value(f"{slider}('aria-valuetext')").startswith("Frame 1 of")
    assert browser.value("document.getElementById('status').getAttribute('aria-live')") == "polite"
    assert browser.value(LEAST_CONTRAST) >= 4.5


ORDER = ["picture", "scrub", "play", "loop", "speed", "camera", "quality", "home", "full", "help"]
LEAST_CONTRAST = """(() => {
  const parts = (color) => color.match(/[0-9.]+/g).map(Number);
  const light = (color) => parts(color).slice(0, 3).map((v) => v / 255)
    .map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4))
    .reduce((sum, v, i) => sum + [0.2126, 0.7152, 0.0722][i] * v, 0);
  const behind = (element) => {
    const color = getComputedStyle(element).backgroundColor, alpha = parts(color)[3];
    return alpha === 0 && element.parentElement ? behind(element.parentElement) : color;
  };
  const all = [...document.querySelectorAll("h1, #words, #buttons *, #bands div, dialog td, dialog button")];
  return Math.min(...all.filter((element) => element.textContent.trim()).map((element) => {
    const [a, b] = [light(getComputedStyle(element).color), light(behind(element))].sort((x, y) => y - x);
    return (a + 0.05) / (b + 0.05);
  }));
})()"""


def test_the_poster_is_seen_before_anything_runs(browser: Browser, server: RangeServer):
    browser.call("Emulation.setScriptExecutionDisabled", value=True)
    try:
        browser.call("Page.navigate", url=server.url("scene.html"))
        browser.wait("document.readyState === 'complete' && document.getElementById('poster').complete")
        assert browser.value("document.querySelector('noscript').innerText").startswith("This page needs JavaScript")
        grey = browser.picture()[200:300, 200:280].reshape(-1, 3).mean(0)
        assert np.ptp(grey) < 3
        assert grey.min() > 60
    finally:
        browser.call("Emulation.setScriptExecutionDisabled", value=False)


@pytest.mark.parametrize("size", [(960, 600), (780, 360)])
def test_the_buttons_take_one_row_and_their_sheet_begins_at_its_top(
    browser: Browser, server: RangeServer, size: tuple[int, int]
):
    browser.resize(*size)
    go_to(browser, server.url("scene.html"))
    browser.value("void (document.getElementById('headset').hidden = innerHeight < 480)")  # phones have none
    tops = browser.value(
        "[...document.querySelectorAll('#buttons > :not([hidden])')].map(b => b.getBoundingClientRect().bottom)"
    )
    assert np.ptp(tops) < 12
    assert browser.value("[...document.querySelectorAll('select')].every(one => one.getAttribute('aria-label'))")
    browser.key("?", modifiers=8)
    assert browser.value("document.getElementById('keys').scrollTop") == 0
    browser.value("void document.getElementById('keys').close()")
