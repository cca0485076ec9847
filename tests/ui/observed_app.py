"""Starts the program exactly as `clipgstream ARGUMENTS` does, and writes what it shows and when into a file.

    python observed_app.py STATE_FILE ARGUMENTS...

STATE_FILE is replaced about ten times a second with JSON: rectangles, time, view, training, notices. STATE_FILE.log
gets one JSON line per forwarded input event, per finished frame and per slow part of a turn of the loop (see
tests.ui.watchdog), with CLOCK_MONOTONIC seconds. Nothing is changed in how the program behaves.
"""

from __future__ import annotations

import json
import os
import sys
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tests.ui.watchdog import Watchdog

STATE_PERIOD_S = 0.1


def describe(studio: Any) -> dict[str, Any]:
    """What a test wants to know of the running window."""
    session = studio.session
    view, timeline, training = session.view, session.timeline, session.training
    scale = studio.frame.backend.pixels_per_unit
    rects = {name: [v * scale for v in (r.x0, r.y0, r.x1, r.y1)] for name, r in studio.frame.ui.rects.items()}
    return {
        "rects": rects,
        "scale": scale,
        "is_still": not studio.frame._redraw.is_due,
        "n_popups": len(studio.frame.backend.context.open_popup_stack),
        "capture": None if session.capture is None else str(session.capture.path),
        "frame_index": timeline.frame_index,
        "n_frames": timeline.n_frames,
        "is_playing": timeline.is_playing,
        "yaw": view.yaw,
        "pitch": view.pitch,
        "distance": view.distance,
        "look_through": view.look_through,
        "compare": session.overlays.compare,
        "training": {"state": training.state, "step": training.step, "n_steps": training.n_steps},
        "clips": [clip.state for clip in session.clip_states],
        "notices": [[notice.kind, notice.title, notice.detail, notice.hint] for notice in session.notices],
        "jobs": [job.name for job in session.jobs],
        "exports": [[one.title, one.state, one.done, one.message] for one in session.exporting.statuses],
        "mending": None if session.mending.page is None else session.mending.page.state,
        "regions": [region.as_dict() for region in session.regions.regions],
        "can_mark": session.regions.can_mark,
        "n_keys": sum(len(path.keys) for path in session.paths.paths),
        "sphere": None if studio.frame.ui.regions.sphere is None else studio.frame.ui.regions.sphere.as_dict(),
        "is_help_open": studio.frame.ui.is_help_open,
        "shows": studio.frame.viewport.scene.shows,
        "hud": None if studio.frame.viewport.hud.text is None else asdict(studio.frame.viewport.hud.text),
    }


def shown_picture(studio: Any) -> dict[str, Any]:
    """What the newest frame of the window shows, and what it ought to show. Looks are told apart by numbers."""
    session, shown = studio.session, studio.frame.viewport.scene.shown
    return {
        "kind": shown.kind,
        "frame": shown.source.frame_index,
        "look": hash(shown.source.look),
        "width": shown.size[0],
        "playhead": session.timeline.frame_index,
        "view": hash(session.view.look_key),
    }


def watch(state_path: Path) -> None:
    """Hook the window class so that each window reports into the file."""
    import ui.shell.window as window_module

    class ObservedWindow(window_module.StudioWindow):
        """The same window, reporting."""

        def __init__(self, *arguments: Any, **options: Any) -> None:
            super().__init__(*arguments, **options)
            self._written_s = 0.0
            self._log = Path(f"{state_path}.log").open("w", buffering=1)  # noqa: SIM115 - open as long as the window
            self._watchdog = Watchdog(self._write)
            self._watch_updates()
            for name in ("on_mouse_motion", "on_mouse_drag", "on_mouse_press", "on_key_press", "on_mouse_scroll"):
                self.window.push_handlers(**{name: self._reporter(name)})

        def _write(self, line: dict[str, Any]) -> None:
            self._log.write(json.dumps(line) + "\n")

        def _watch_updates(self) -> None:
            update = self.frame.update

            def watched(dt_s: float) -> bool:
                with self._watchdog.phase("update"):
                    return update(dt_s)

            self.frame.update = watched

        def _reporter(self, name: str) -> Any:
            def report(*values: float) -> None:
                self._write({"event": name, "values": values[:2], "at_s": time.monotonic()})

            return report

        def draw(self) -> None:
            started_s = time.monotonic()
            with self._watchdog.phase("draw"):
                super().draw()
                self.ctx.finish()  # so that the time is that of the finished picture
            self._write({"frame_s": started_s, "at_s": time.monotonic()} | shown_picture(self))

        def tick(self, dt_s: float) -> None:
            super().tick(dt_s)
            if time.monotonic() - self._written_s > STATE_PERIOD_S:
                self._written_s = time.monotonic()
                temporary = Path(f"{state_path}.new")
                temporary.write_text(json.dumps(describe(self)))
                os.replace(temporary, state_path)

    window_module.StudioWindow = ObservedWindow


if __name__ == "__main__":
    import pyglet

    pyglet.options.shadow_window = False
    watch(Path(sys.argv[1]))
    from ui.main import main

    sys.exit(main(sys.argv[2:]))
