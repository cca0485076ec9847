"""A headless Chromium, driven through a pair of pipes by its own protocol. Needs no driver program and no package.

https://chromedevtools.github.io/devtools-protocol/ names the methods and events.
"""

from __future__ import annotations

import base64
import fcntl
import io
import json
import os
import select
import shutil
import signal
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
    "--remote-debugging-pipe",
)
WEBGPU_FLAGS = (
    "--enable-unsafe-webgpu",
    "--use-webgpu-adapter=swiftshader",
    "--enable-features=Vulkan",
    "--use-vulkan=swiftshader",
)
"""Further flags, with which there is WebGPU in software."""
AS_A_CARD = """(() => {
  const type = WebGL2RenderingContext.prototype, ask = type.getParameter;
  type.getParameter = function (name) { return name === 0x9246 ? "A card" : ask.call(this, name); };
})();"""
"""A script before the page's own, so that it takes the browser's software for a graphics card."""
WITHOUT_WEBGPU = "Object.defineProperty(Navigator.prototype, 'gpu', {value: undefined});"
AS_A_CARD_WITH_WEBGPU = (
    f"{AS_A_CARD} Object.defineProperty(GPUAdapterInfo.prototype, 'isFallbackAdapter', {{get: () => false}});"
)
"""The same with `WEBGPU_FLAGS`."""
_FIRST_FREE_FD = 10
WAIT_S = 180.0
"""For an answer, or for something to come true: only a hang takes so long, even on a machine that is busy."""


def chromium() -> str | None:
    """The browser's program, or None."""
    return next(filter(None, map(shutil.which, NAMES)), None)


class Browser:
    """One page in a browser of its own. A context manager.

    Attributes:
        console: What the page and the browser said about it: warnings, errors, exceptions.
        requests: URLs that were asked for.
        pid: Of the browser, which leads its processes.
    """

    def __init__(self, folder: Path, *, width: int = 800, height: int = 600, flags: Sequence[str] = ()) -> None:
        program = chromium()
        assert program is not None
        self.console: list[str] = []
        self.requests: list[str] = []
        self._number, self._text = 0, b""
        from_us, self._to = _pipe()
        self._from, to_us = _pipe()
        log = _moved_up(os.open(folder / "chromium.log", os.O_CREAT | os.O_WRONLY))
        arguments = [
            program,
            *FLAGS,
            *flags,
            f"--user-data-dir={folder / 'profile'}",
            f"--window-size={width},{height}",
        ]
        self.pid = os.posix_spawn(
            program,
            [*arguments, "about:blank"],
            os.environ,
            file_actions=[
                (os.POSIX_SPAWN_DUP2, from_us, 3),
                (os.POSIX_SPAWN_DUP2, to_us, 4),
                (os.POSIX_SPAWN_DUP2, log, 1),
                (os.POSIX_SPAWN_DUP2, log, 2),
            ],
            setpgroup=0,
        )
        for end in (from_us, to_us, log):
            os.close(end)
        self._session: str | None = None
        self._session = self.call("Target.attachToTarget", targetId=self._first_page(), flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.resize(width, height)

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._to)
        os.close(self._from)
        for sent in (signal.SIGTERM, signal.SIGKILL):
            try:
                os.killpg(self.pid, sent)
            except ProcessLookupError:
                break
            time.sleep(0.1)
        os.waitpid(self.pid, 0)

    def _first_page(self) -> str:
        """The page that the browser opens, which answers before it has done so."""
        until_s = time.monotonic() + WAIT_S
        while True:
            for target in self.call("Target.getTargets")["targetInfos"]:
                if target["type"] == "page":
                    return target["targetId"]
            assert time.monotonic() < until_s, "the browser opens no page"
            time.sleep(0.03)

    # ---------------------------------------------------------------- the protocol

    def call(self, method: str, *, timeout_s: float = WAIT_S, **params: Any) -> dict[str, Any]:
        """Carry out a method of the protocol."""
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": params}
        if self._session is not None:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        until_s = time.monotonic() + timeout_s
        while True:
            answer = self._message(until_s - time.monotonic())
            if answer is None:
                raise TimeoutError(f"{method} was not answered within {timeout_s} s")
            if answer.get("id") == self._number:
                assert "error" not in answer, f"{method}: {answer['error']}"
                return answer["result"]
            self._note(answer)

    def _message(self, timeout_s: float) -> dict[str, Any] | None:
        while b"\0" not in self._text:
            if not select.select([self._from], [], [], max(timeout_s, 0.0))[0]:
                return None
            piece = os.read(self._from, 1 << 20)
            assert piece, "the browser has ended"
            self._text += piece
        message, _, self._text = self._text.partition(b"\0")
        return json.loads(message)

    def _note(self, event: dict[str, Any]) -> None:
        params = event.get("params", {})
        match event.get("method"):
            case "Runtime.consoleAPICalled":
                words = [str(value.get("value", value.get("description", ""))) for value in params["args"]]
                self.console.append(f"{params['type']}: {' '.join(words)}")
            case "Runtime.exceptionThrown":
                self.console.append(f"exception: {json.dumps(params['exceptionDetails'])}")
            case "Log.entryAdded":
                self.console.append(f"{params['entry']['level']}: {params['entry']['text']}")
            case "Network.requestWillBeSent":
                self.requests.append(params["request"]["url"])

    # ---------------------------------------------------------------- what a user does and sees

    def open(self, page: Path) -> None:
        """Go to a page on the disk."""
        self.call("Page.navigate", url=page.resolve().as_uri())

    def before_pages(self, script: str) -> str:
        """Run a script in every page before its own. Returns its number."""
        return self.call("Page.addScriptToEvaluateOnNewDocument", source=script)["identifier"]

    def resize(self, width: int, height: int, *, ratio: float = 1.0, is_phone: bool = False) -> None:
        """Size of the page in its own pixels, and how many of the screen's make one of them."""
        self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=ratio, mobile=is_phone
        )

    def value(self, expression: str) -> Any:
        """What an expression of JavaScript gives, waited for."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def wait(self, expression: str, *, timeout_s: float = WAIT_S) -> None:
        """Until an expression is true."""
        until_s = time.monotonic() + timeout_s
        while not self.value(expression):
            assert time.monotonic() < until_s, f"never came true: {expression}; console: {self.console}"
            time.sleep(0.03)

    def picture(self) -> np.ndarray:
        """What is seen of the page. [H, W, 3] uint8"""
        data = self.call("Page.captureScreenshot", format="png")["data"]
        return np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB"))

    def key(self, key: str, *, text: str = "", code: str = "", modifiers: int = 0) -> None:
        """Press a key: its name as in KeyboardEvent.key. modifiers: 1 Alt, 2 Ctrl, 8 Shift"""
        down: dict[str, Any] = {"text": text} if text else {}
        self.call("Input.dispatchKeyEvent", type="keyDown", key=key, code=code, modifiers=modifiers, **down)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key, code=code, modifiers=modifiers)

    def mouse(self, kind: str, x: float, y: float, **more: Any) -> None:
        """One event of the mouse: mousePressed, mouseMoved, mouseReleased or mouseWheel."""
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def drag(self, start: tuple[float, float], end: tuple[float, float], *, button: str = "left") -> None:
        """Press, move in steps and release."""
        held = {"button": button, "buttons": {"left": 1, "right": 2}[button], "clickCount": 1}
        self.mouse("mousePressed", *start, **held)
        for share in (0.25, 0.5, 0.75, 1.0):
            self.mouse("mouseMoved", *(a + share * (b - a) for a, b in zip(start, end, strict=True)), **held)
        self.mouse("mouseReleased", *end, **held)

    def click(self, x: float, y: float) -> None:
        """Press and release the left button."""
        self.drag((x, y), (x, y))

    def touch(self, *fingers: list[tuple[float, float]], at_s: float | None = None) -> None:
        """Fingers along their paths, all of the same number of points. at_s: when, of time.time()"""
        when = {} if at_s is None else {"timestamp": at_s}
        for step, points in enumerate(zip(*fingers, strict=True)):
            kind = "touchMove" if step else "touchStart"
            self.call("Input.dispatchTouchEvent", type=kind, touchPoints=[{"x": x, "y": y} for x, y in points], **when)
        self.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[], **when)


def _pipe() -> tuple[int, int]:
    ours, theirs = map(_moved_up, os.pipe())
    return ours, theirs


def _moved_up(descriptor: int) -> int:
    """The same, but not among the first few numbers, which the browser expects its own ends at."""
    moved = fcntl.fcntl(descriptor, fcntl.F_DUPFD_CLOEXEC, _FIRST_FREE_FD)
    os.close(descriptor)
    return moved
