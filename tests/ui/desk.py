"""A virtual screen (Xvfb) with the program on it, driven by real pointer and key events (xdotool)."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
PROGRAMS = ("Xvfb", "xdotool", "xwd")
SCREEN = (1320, 840)
WINDOW = (1280, 800)
POLL_S = 0.02
WAIT_S = 300.0
"""Only a hang takes longer, even on a machine that is busy."""


def missing_programs() -> list[str]:
    """What has to be installed before a Desk can be used."""
    return [program for program in PROGRAMS if shutil.which(program) is None]


class Desk:
    """One Xvfb, one program, one xdotool. Everything started here is ended by `close`.

    Args:
        folder: For reports and output of the program.
        arguments: Of the program.
        size: Of its window, px.
    """

    def __init__(self, folder: Path, arguments: list[str], *, size: tuple[int, int] = WINDOW) -> None:
        self._folder, self._size = folder, size
        self._state_path = folder / "state.json"
        self._children: list[subprocess.Popen[Any]] = []
        display = self._start_screen()
        self._environment = {**os.environ, "DISPLAY": display, "PYTHONPATH": str(ROOT)}
        command = [sys.executable, str(ROOT / "tests" / "ui" / "observed_app.py"), str(self._state_path)]
        command += ["--size", f"{size[0]}x{size[1]}", *arguments]
        self._output = (folder / "program.txt").open("w")
        self.program = subprocess.Popen(
            command, env=self._environment, stdout=self._output, stderr=subprocess.STDOUT, cwd=ROOT
        )
        self._children.append(self.program)
        self._pointer = subprocess.Popen(
            ["xdotool", "-"], env=self._environment, stdin=subprocess.PIPE, text=True, bufsize=1
        )
        self._children.append(self._pointer)

    def _start_screen(self) -> str:
        reader, writer = os.pipe()
        size = f"{SCREEN[0]}x{SCREEN[1]}x24"
        server = subprocess.Popen(
            ["Xvfb", "-displayfd", str(writer), "-screen", "0", size, "-nolisten", "tcp"],
            pass_fds=(writer,),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        self._children.append(server)
        os.close(writer)
        with os.fdopen(reader) as numbers:
            return f":{numbers.readline().strip()}"

    # ---- what the program shows ------------------------------------------------------------------------------

    @property
    def state(self) -> dict[str, Any]:
        """The newest report of the program; empty before the first."""
        try:
            return json.loads(self._state_path.read_text())
        except FileNotFoundError:
            return {}

    def wait_for(self, what: str, is_so: Callable[[dict[str, Any]], bool], timeout_s: float = WAIT_S) -> dict[str, Any]:
        """Poll the reports until one fits.

        Raises:
            AssertionError: Time is up or the program ended; the message holds the last report and its output.
        """
        deadline_s = time.monotonic() + timeout_s
        state: dict[str, Any] = {}
        while time.monotonic() < deadline_s and self.program.poll() is None:
            state = self.state
            if state and is_so(state):
                return state
            time.sleep(POLL_S)
        output = (self._folder / "program.txt").read_text()[-4000:]
        raise AssertionError(f"waited {timeout_s:g} s for: {what}\nlast state: {state}\noutput: {output}")

    def log_lines(self) -> list[dict[str, Any]]:
        """Events and frames so far; see observed_app."""
        text = Path(f"{self._state_path}.log").read_text()
        return [json.loads(line) for line in text.splitlines() if line.endswith("}")]

    # ---- hands -----------------------------------------------------------------------------------------------

    def do(self, *commands: str) -> float:
        """Send xdotool commands; returns CLOCK_MONOTONIC seconds just before."""
        assert self._pointer.stdin is not None
        sent_s = time.monotonic()
        for command in commands:
            self._pointer.stdin.write(command + "\n")
        self._pointer.stdin.flush()
        return sent_s

    def center(self, name: str) -> tuple[float, float]:
        """Middle of a rectangle that the program reported."""
        x0, y0, x1, y1 = self.wait_for(f"{name} on screen", lambda state: name in state["rects"])["rects"][name]
        return (x0 + x1) / 2, (y0 + y1) / 2

    def move(self, x: float, y: float) -> float:
        """Pointer to window coordinates; the window lies at the screen's corner."""
        return self.do(f"mousemove {round(x)} {round(y)}")

    def click(self, name: str) -> None:
        """Click the middle of a reported rectangle."""
        self.move(*self.center(name))
        self.do("mousedown 1", "mouseup 1")

    def drag(self, start: tuple[float, float], stop: tuple[float, float], *, button: int = 1, steps: int = 8) -> None:
        """Press, move in steps, release."""
        self.move(*start)
        self.do(f"mousedown {button}")
        for i in range(1, steps + 1):
            self.move(start[0] + (stop[0] - start[0]) * i / steps, start[1] + (stop[1] - start[1]) * i / steps)
            self.do("sleep 0.03")
        self.do(f"mouseup {button}")

    def key(self, name: str) -> None:
        """Press and release, with xdotool's key names."""
        self.do(f"key {name}")

    def focus(self) -> None:
        """Give the window the keyboard: there is no window manager to do it."""
        found = subprocess.run(
            ["xdotool", "search", "--sync", "--onlyvisible", "--name", "ClipGStream"],
            env=self._environment,
            capture_output=True,
            text=True,
            check=True,
            timeout=WAIT_S,
        )
        self.do(f"windowfocus {found.stdout.split()[0]}")

    def screenshot(self, path: Path) -> Path:
        """The screen as X shows it, cut to the window."""
        from tests.ui.xwd import read_xwd
        from ui.shell.screenshot import write_png

        dump = subprocess.run(
            ["xwd", "-root", "-silent"], env=self._environment, capture_output=True, check=True, timeout=WAIT_S
        )
        image = read_xwd(dump.stdout)
        return write_png(image[: self._size[1], : self._size[0]], path)

    def close(self) -> int | None:
        """Ask the program to end, then end the rest. Returns the program's exit code."""
        if self._pointer.stdin is not None:
            self._pointer.stdin.close()
        for child in (self.program, *reversed(self._children)):
            if child.poll() is None:
                child.terminate()
                try:
                    child.wait(WAIT_S)
                except subprocess.TimeoutExpired:
                    child.kill()
                    child.wait(WAIT_S)
        self._output.close()
        return self.program.returncode
