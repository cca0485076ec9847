"""Does the window answer while a clip trains? Input-to-picture latency and frame time under Xvfb with software GL.

    python tests/benchmarks/bench_window.py CAPTURE [--seconds 30] [--no-training]

Real pointer and key events are sent one at a time. The latency of one is the time from just before xdotool is told,
until the first frame that begins after the program saw the event is finished on the software renderer. So it contains
xdotool, the X server, waiting for a frame under way, and drawing. Needs Xvfb, xdotool and xwd.
"""

from __future__ import annotations

import argparse
import os
import platform
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.ui.desk import Desk, missing_programs

BUDGET_MS = 100.0
GAP_S = 0.15
LOOK_BACK_S = 0.002


def answer_times_ms(sent: list[tuple[str, float]], log: list[dict[str, Any]]) -> dict[str, list[float]]:
    """Per kind of input, milliseconds from sending to the end of the first frame begun after the program saw it.

    Args:
        sent: Kind and CLOCK_MONOTONIC seconds, in order.
        log: Lines of observed_app, in order.
    """
    events = [line["at_s"] for line in log if "event" in line]
    frames = [(line["frame_s"], line["at_s"]) for line in log if "frame_s" in line]
    answers: dict[str, list[float]] = {}
    for i, (kind, sent_s) in enumerate(sent):
        end_s = sent[i + 1][1] if i + 1 < len(sent) else float("inf")
        seen = next((at_s for at_s in events if sent_s - LOOK_BACK_S <= at_s < end_s), None)
        if seen is None:
            continue
        finished = next((stop_s for start_s, stop_s in frames if start_s >= seen), None)
        if finished is not None:
            answers.setdefault(kind, []).append((finished - sent_s) * 1e3)
    return answers


def drive(desk: Desk, seconds: float) -> list[tuple[str, float]]:
    """Orbit, scrub, dolly and step in turn; returns what was sent when."""
    sent: list[tuple[str, float]] = []
    x, y = desk.center("viewport.canvas")
    track = desk.state["rects"]["timeline.track"]
    deadline_s = time.monotonic() + seconds
    turn = 0
    while time.monotonic() < deadline_s:
        desk.move(x, y)
        desk.do("mousedown 1")
        time.sleep(GAP_S)
        for i in range(1, 9):
            sent.append(("orbit", desk.move(x + 9 * i, y + 3 * i)))
            time.sleep(GAP_S)
        desk.do("mouseup 1")
        time.sleep(GAP_S)
        start = track[0] + 6
        desk.move(start, track[1] + 10)
        desk.do("mousedown 1")
        time.sleep(GAP_S)
        for i in range(1, 9):
            share = ((turn * 3 + i) % 11) / 11
            sent.append(("scrub", desk.move(start + share * (track[2] - track[0] - 12), track[1] + 10)))
            time.sleep(GAP_S)
        desk.do("mouseup 1")
        desk.move(x, y)
        time.sleep(GAP_S)
        for button in (4, 5, 4, 5):
            sent.append(("dolly", desk.do(f"click {button}")))
            time.sleep(GAP_S)
        for name in ("Right", "Left", "bracketright", "f"):
            sent.append(("key", desk.do(f"key {name}")))
            time.sleep(GAP_S)
        turn += 1
    return sent


def report(title: str, answers: dict[str, list[float]], log: list[dict[str, Any]], since_s: float) -> float:
    """Print one table; returns the largest latency, ms."""
    frames = [(line["at_s"] - line["frame_s"]) * 1e3 for line in log if line.get("frame_s", 0) >= since_s]
    print(f"\n{title}")
    print(f"{'input':10}{'n':>6}{'median ms':>12}{'p95 ms':>10}{'max ms':>10}")
    every: list[float] = []
    for kind, times in answers.items():
        every += times
        ordered = sorted(times)
        p95 = ordered[min(int(0.95 * len(ordered)), len(ordered) - 1)]
        print(f"{kind:10}{len(times):6}{statistics.median(times):12.1f}{p95:10.1f}{max(times):10.1f}")
    late = sum(t > BUDGET_MS for t in every)
    print(f"{'all':10}{len(every):6}{statistics.median(every):12.1f}{'':10}{max(every):10.1f}")
    print(f"over {BUDGET_MS:.0f} ms: {late} of {len(every)};  frames drawn {len(frames)}, ", end="")
    print(f"median {statistics.median(frames):.1f} ms, max {max(frames):.1f} ms")
    for line in log:
        if "slow" in line and line["at_s"] >= since_s:
            print(
                f"  {line['slow']}: {line['wall_ms']} ms, of it computing {line['computed_ms']}, waiting for a core ",
                end="",
            )
            print(f"{line['waited_for_a_core_ms']}; other threads computed {line['other_threads_computed_ms']}")
            for text in (*line["stacks"], *line["others"]):
                print(f"      {text}")
    return max(every)


def main() -> int:
    """Run and print; the exit code tells whether every input was answered in time."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", type=Path)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--no-training", action="store_true")
    parser.add_argument("--steps-timeout", type=float, default=400.0, help="seconds to wait for the first step")
    options = parser.parse_args()
    missing = missing_programs()
    if missing:
        print(f"not installed: {', '.join(missing)}")
        return 1
    with tempfile.TemporaryDirectory() as name:
        for variable in ("XDG_DATA_HOME", "XDG_CONFIG_HOME"):
            os.environ[variable] = name
        desk = Desk(Path(name), [str(options.capture.resolve())])
        try:
            worst = measure(desk, options)
        finally:
            desk.close()
    machine = f"{platform.platform()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}"
    print(f"\n{machine}, Python {platform.python_version()}")
    return 0 if worst <= BUDGET_MS else 3


def measure(desk: Desk, options: argparse.Namespace) -> float:
    """Idle, while preparing, and while stepping. Returns the largest latency of all, ms."""
    desk.wait_for("an open capture", lambda s: s["capture"] is not None and "timeline.track" in s["rects"], 60)
    desk.wait_for("something to look at", lambda s: s["shows"] != "Cameras only", 30)
    desk.focus()
    phases = [("nothing trains", "")]
    if not options.no_training:
        phases += [("while a clip is prepared", "preparing"), ("while a clip trains", "running")]
    phases = [phase for phase in phases if phase[1] in os.environ.get("PHASES", ",preparing,running").split(",")]
    worst = 0.0
    for title, state_name in phases:
        if state_name and desk.state["training"]["state"] == "idle":
            desk.click("training.next")
        if state_name:
            wanted = (state_name, "running")
            desk.wait_for(state_name, lambda s, w=wanted: s["training"]["state"] in w, options.steps_timeout)
        if state_name == "running":
            desk.key("Home")  # into the clip that trains; scrubbing left the playhead elsewhere
            desk.wait_for("a trained picture", lambda s: s["shows"] == "Rendered", options.steps_timeout)
        since_s = time.monotonic()
        sent = drive(desk, options.seconds)
        time.sleep(0.5)
        log = desk.log_lines()
        state = desk.state["training"]["state"]
        worst = max(
            worst, report(f"{title} (training is {state} at the end)", answer_times_ms(sent, log), log, since_s)
        )
    return worst


if __name__ == "__main__":
    sys.exit(main())
