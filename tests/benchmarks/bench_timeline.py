"""How long drawing the timeline takes: 10,000 frames in 1,000 clips, all of them and parts of them.

    python tests/benchmarks/bench_timeline.py [--frames 10000] [--clips 1000] [--draws 200]

A headless window with a made-up capture is drawn again and again, with the playhead moving on. What is timed is the
call that draws the panel: all of its Python, and ImGui's share of building its draw lists, as processor time of the UI
thread, which other programs on the machine change little.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pyglet

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
pyglet.options.headless = True
pyglet.options.shadow_window = False

from tests.ui.long_capture import long_session  # noqa: E402
from tests.ui.pilot import Pilot  # noqa: E402
from ui.panels.state import TIMELINE, UiState  # noqa: E402
from ui.panels.timeline.time_range import range_around  # noqa: E402
from ui.shell.window import StudioWindow  # noqa: E402

BUDGET_MS = 4.0


def draw_times_ms(pilot: Pilot, n_draws: int) -> list[float]:
    """Processor time of every draw of the timeline in milliseconds, with the playhead moving on by a frame."""
    times: list[float] = []
    frame = pilot.studio.frame
    panels = frame._panels

    def timed(draw: Callable[..., None]) -> Callable[..., None]:
        def draw_timed(session: object, dispatch: object, ui: UiState) -> None:
            start_s = time.thread_time()
            draw(session, dispatch, ui)
            times.append((time.thread_time() - start_s) * 1e3)

        return draw_timed

    frame._panels = tuple(
        (title, timed(draw) if title == TIMELINE else draw, has_padding) for title, draw, has_padding in panels
    )
    timeline = pilot.session.timeline
    for _ in range(n_draws):
        timeline.go_to((timeline.frame_index + 1) % timeline.n_frames)
        frame.draw()
    frame._panels = panels
    return times


def main() -> int:
    """Prints a table; 1 where the median of some case is over the budget."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=10_000)
    parser.add_argument("--clips", type=int, default=1_000)
    parser.add_argument("--draws", type=int, default=200)
    parser.add_argument("--width", type=int, default=1280)
    arguments = parser.parse_args()
    n_frames, n_clips = arguments.frames, arguments.clips
    is_slow = False
    print(f"{n_frames} frames, {n_clips} clips, window {arguments.width} wide; milliseconds per draw")
    print(f"{'shown':32} {'states':12} {'median':>8} {'95 %':>8}")
    for states in ("usual", "alternating"):
        session = long_session(n_frames, n_clips, is_alternating=states == "alternating")
        studio = StudioWindow(session, width=arguments.width, height=800, fixed_delta_s=1 / 60)
        studio.window._enable_event_queue = False
        pilot = Pilot(studio)
        pilot.draw(8)
        view = studio.frame.ui.timeline
        for shown in (n_frames, n_frames // 2, n_frames // 5, n_frames // 20, 100, 20):
            view.show(range_around(n_frames // 3, n_frames // 3 + shown, n_frames), n_frames)
            session.timeline.go_to(n_frames // 3)
            draw_times_ms(pilot, 10)
            times = sorted(draw_times_ms(pilot, arguments.draws))
            median, late = statistics.median(times), times[int(0.95 * len(times))]
            is_slow |= median > BUDGET_MS
            length = view.range_of(n_frames).length
            print(f"{f'{length:.0f} frames':32} {states:12} {median:8.2f} {late:8.2f}")
        studio.close()
    return int(is_slow)


if __name__ == "__main__":
    raise SystemExit(main())
