"""How soon does a selection show? A headless window with a made scene, from the command to the finished frame.

    python tests/benchmarks/bench_selecting.py CAPTURE [--gaussians 100000] [--runs 9]

What is timed is what a user waits for after a drag has ended: the thread that finds the Gaussians, the session that
takes them up, and the first frame of the window in which they are marked, finished by the software renderer. The
outline of where they are seen follows a little later and is timed, too. What the engine takes alone stands beside it.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyglet

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
pyglet.options.headless = True
pyglet.options.shadow_window = False

from app.session.editing.finding import Ground, found_by  # noqa: E402
from app.session.editing.selection_commands import (  # noqa: E402
    Brush,
    ClearSelection,
    GrowSelection,
    Lasso,
    Rectangle,
    SelectByAttribute,
    SelectFlood,
    SelectInPicture,
    SelectionCommand,
    SelectVolume,
)
from app.session.projects.project_commands import OpenProject  # noqa: E402# noqa: E402
from app.session.session import Session  # noqa: E402
from engine.editing.edit import Sphere  # noqa: E402
from engine.editing.selection.seen_from import SeenFrom  # noqa: E402
from engine.kernels.cache import use_kernel_cache  # noqa: E402
from tests.benchmarks.made_scene import make_scene  # noqa: E402
from ui.shell.window import StudioWindow  # noqa: E402
from ui.viewport.hud_text import RENDERED  # noqa: E402

BUDGET_MS = 100.0
SIZE = (1280, 800)
WAIT_S = 300.0


class Timed:
    """A window over a session, turned by hand."""

    def __init__(self, project: Path) -> None:
        self.session = Session(project_dir=project, is_preloading=False)
        self.studio = StudioWindow(self.session, width=SIZE[0], height=SIZE[1], fixed_delta_s=1 / 60)
        self.session.dispatch(OpenProject(project))
        self.turn_until(lambda: self.session.capture is not None)
        overlays = self.session.overlays
        overlays.show_frusta = overlays.show_inherited = overlays.show_residual = False
        self.turn_until(self._is_rendered)

    def _is_rendered(self) -> bool:
        scene = self.studio.frame.viewport.scene
        return scene.shows == RENDERED and not scene.shown.is_on_its_way

    def turn_until(self, is_done: Callable[[], bool]) -> None:
        """Turn the window's loop as it turns by itself."""
        deadline_s = time.monotonic() + WAIT_S
        while not is_done():
            assert time.monotonic() < deadline_s, list(self.session.notices)
            if self.studio.frame.update(1 / 60):
                self.studio.draw()
                self.studio.ctx.finish()
            else:
                time.sleep(0.001)

    def view(self) -> SeenFrom:
        """As the picture is seen."""
        view, area = self.session.view, self.studio.frame.ui.rects["viewport.rendered"]
        size = round(area.width), round(area.height)
        return SeenFrom(view.world_to_camera(), view.K(*size), *size, view.near, view.set_back)

    def times_ms(self, command: SelectionCommand) -> tuple[float, float]:
        """Until the selection is marked, and until its outline is there."""
        layer = self.studio.frame.viewport.scene.selection
        if not isinstance(command, GrowSelection):
            self.session.dispatch(ClearSelection())
        self.turn_until(lambda: layer.is_empty or isinstance(command, GrowSelection))
        self.studio.settle(3)
        revision, start_s = self.session.selection.revision, time.perf_counter()
        self.session.dispatch(command)
        self.turn_until(lambda: self.session.selection.revision != revision and not layer.is_empty)
        self._draw()
        marked_s = time.perf_counter()
        self.turn_until(lambda: layer.is_share_shown)
        self._draw()
        return 1e3 * (marked_s - start_s), 1e3 * (time.perf_counter() - start_s)

    def _draw(self) -> None:
        if self.studio.frame.update(1 / 60):
            self.studio.draw()
        self.studio.ctx.finish()

    def engine_ms(self, command: SelectionCommand) -> float:
        """What finding takes by itself, as processor time, which other programs change little."""
        gaussians = self.session.shown_gaussians()
        assert gaussians is not None
        ground = Ground(gaussians, self.session.selected(gaussians))
        start_s = time.thread_time()
        found_by(command, ground)
        return 1e3 * (time.thread_time() - start_s)

    def close(self) -> None:
        """End both."""
        self.studio.close()
        self.session.close()


def commands(view: SeenFrom, pivot: np.ndarray, radius: float) -> dict[str, SelectionCommand]:
    """One of each kind, in the middle of the picture."""
    x, y = view.width / 2, view.height / 2
    reach = 0.3 * view.height
    angles = np.linspace(0.0, 2.0 * np.pi, 300)
    circle = tuple((float(x + reach * np.cos(a)), float(y + reach * np.sin(a))) for a in angles)
    rectangle = Rectangle(x - reach, y - reach, x + reach, y + reach)
    center = (float(pivot[0]), float(pivot[1]), float(pivot[2]))
    return {
        "rectangle, through": SelectInPicture(rectangle, view),
        "rectangle, visible only": SelectInPicture(rectangle, view, is_visible_only=True),
        "lasso, visible, by extent": SelectInPicture(Lasso(circle), view, is_visible_only=True, is_by_extent=True),
        "brush, visible only": SelectInPicture(Brush(circle, 20.0), view, is_visible_only=True),
        "sphere": SelectVolume(Sphere((center[0] + radius, center[1], center[2]), 0.6 * radius)),
        "flood": SelectFlood((center[0] + radius, center[1], center[2]), 0.06 * radius, 1.0),
        "opacity": SelectByAttribute("opacity", 0.0, 1.0),
        "grow": GrowSelection(0.02 * radius),
    }


def main() -> int:
    """Prints a table; 1 where the median of some case is over the budget."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", type=Path)
    parser.add_argument("--gaussians", type=int, default=100_000)
    parser.add_argument("--runs", type=int, default=9)
    arguments = parser.parse_args()
    use_kernel_cache()
    is_slow = False
    with tempfile.TemporaryDirectory() as folder:
        timed = Timed(make_scene(Path(folder) / "made", arguments.capture, arguments.gaussians))
        gaussians, pivot = timed.session.shown_gaussians(), timed.session.view.pivot
        assert gaussians is not None
        radius = float(np.median(np.linalg.norm(gaussians.means - pivot, axis=1)))
        print(f"{len(gaussians)} Gaussians; medians of {arguments.runs}, milliseconds")
        print(f"{'selected by':28} {'engine':>8} {'marked':>8} {'outlined':>9} {'selected':>9}")
        for name, command in commands(timed.view(), pivot, radius).items():
            if isinstance(command, GrowSelection):
                x, y, z = (float(value) for value in pivot)
                timed.times_ms(SelectVolume(Sphere((x, y, z), 0.9 * radius)))
            engine_ms = statistics.median(timed.engine_ms(command) for _ in range(arguments.runs))
            times = [timed.times_ms(command) for _ in range(arguments.runs)]
            marked, outlined = (statistics.median(column) for column in zip(*times, strict=True))
            is_slow |= marked > BUDGET_MS
            n_selected = timed.session.selection.n_gaussians
            print(f"{name:28} {engine_ms:8.1f} {marked:8.1f} {outlined:9.1f} {n_selected:9d}", flush=True)
        timed.close()
    return int(is_slow)


if __name__ == "__main__":
    raise SystemExit(main())
