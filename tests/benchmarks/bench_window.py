"""Does the window answer? Times under Xvfb with software GL, beside the targets of a calm and of a training window.

    python -m tests.benchmarks.bench_window CAPTURE [--seconds 30] [--no-training]
    python -m tests.benchmarks.bench_window PROJECT --parts scrub,play

Real pointer and key events are sent. The answer to one is timed from just before xdotool is told, until the first frame
that begins after the program saw the event is finished on the software renderer. So it contains xdotool, the X server,
waiting for a frame under way, and drawing. An image counts when it is of the frame and view after the input, or of
later ones. Slow turns of the window's loop are listed with what they waited for. Needs Xvfb, xdotool and xwd.

CAPTURE is trained from nothing; of PROJECT, whose clips are trained already, a copy is opened.
"""

from __future__ import annotations

import argparse
import os
import platform
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.benchmarks.made_scene import make_scene
from tests.benchmarks.window_log import (
    HEADING,
    Sent,
    answer_times_ms,
    frames_per_s,
    image_gaps_ms,
    image_times_ms,
    row,
)
from tests.ui.desk import Desk, missing_programs

BUDGET_MS = 100.0
GAP_S = 0.15
DRAG_GAP_S = 0.02
SIZE = (1280, 720)
PARTS = ("orbit", "scrub", "play", "answers")
MADE = (50_000, 200_000)
PLAY_S = 6.0
SETTLE_S = 0.2
"""Long enough to load a clip, too short for frames to be made ahead."""


# ---- hands ---------------------------------------------------------------------------------------------------


def drive(desk: Desk, seconds: float) -> Sent:
    """Orbit, scrub, dolly and step in turn; returns what was sent when."""
    sent: Sent = []
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


def orbit(desk: Desk, seconds: float) -> Sent:
    """Drag the view round without a pause."""
    x, y = desk.center("viewport.canvas")
    desk.move(x - 150, y)
    desk.do("mousedown 1")
    time.sleep(GAP_S)
    sent: Sent = []
    for i in range(int(seconds / DRAG_GAP_S)):
        sent.append(("orbit", desk.move(x - 150 + abs((4 * i) % 600 - 300), y + 20 * ((i // 40) % 2))))
        time.sleep(DRAG_GAP_S)
    desk.do("mouseup 1")
    return sent


def scrub(desk: Desk, frames: list[int], gap_s: float) -> Sent:
    """Press the timeline at frames in turn."""
    state = desk.state
    track, n_frames = state["rects"]["timeline.track"], state["n_frames"]
    sent: Sent = []
    for frame in frames:
        x = track[0] + (frame + 0.5) / n_frames * (track[2] - track[0])
        desk.move(x, track[1] + 10)
        sent.append(("scrub", desk.do("mousedown 1")))
        desk.do("mouseup 1")
        time.sleep(gap_s)
    return sent


# ---- parts ---------------------------------------------------------------------------------------------------


def measure_orbit(desk: Desk, title: str, seconds: float, targets: tuple[str, str]) -> list[str]:
    """Images while the view is dragged round."""
    began_s = time.monotonic()
    sent = orbit(desk, seconds)
    ended_s = time.monotonic()
    time.sleep(1.0)
    log = desk.log_lines()
    images = image_times_ms(sent, log).get("orbit", [])
    return [
        row(f"{title}: from image to image", image_gaps_ms(log, began_s, ended_s), target=targets[0]),
        row(f"{title}: input to image", images, target=targets[1]),
        *slow_turns(log, began_s),
    ]


def measure_scrub(desk: Desk) -> list[str]:
    """Frames in a leaping order, then again: inside of a clip that is loaded, and over all clips."""
    n, n_clips = desk.state["n_frames"], max(len(desk.state["clips"]), 1)
    length = -(-n // n_clips)
    begin = length * (n_clips // 2)
    inside = leaping(list(range(begin + 1, min(begin + length, n))))
    began_s = time.monotonic()
    lines = []
    for where, order, before in (("in a clip", inside, begin), ("all clips", leaping(list(range(n))), 0)):
        scrub(desk, [before], 0.25)
        time.sleep(SETTLE_S)
        for title, target in (("cold", "60 at p95 (sample)"), ("warm", "20 at p95 (sample)")):
            sent = scrub(desk, order, 0.25)
            time.sleep(1.0)
            images = image_times_ms(sent, desk.log_lines()).get("scrub", [])
            lines.append(row(f"scrub {where}, {title}", images, target=target if where == "in a clip" else ""))
    return [*lines, *slow_turns(desk.log_lines(), began_s)]


def leaping(frames: list[int]) -> list[int]:
    """The same frames, none beside the one before."""
    stride = next(s for s in (7, 11, 13) if len(frames) % s)
    return [frames[(5 + stride * i) % len(frames)] for i in range(len(frames))]


def measure_play(desk: Desk) -> list[str]:
    """Play for a while, and once more."""
    lines = []
    desk.key("Home")
    time.sleep(0.5)
    began_s = time.monotonic()
    desk.key("space")
    for title in ("first", "next"):
        since_s = time.monotonic()
        time.sleep(PLAY_S)
        until_s = time.monotonic()
        log = desk.log_lines()
        rate = frames_per_s(log, since_s, until_s)
        shown = [line["width"] for line in log if line.get("frame_s", 0) >= since_s]
        says = (desk.state["hud"] or {}).get("rate", "")
        lines.append(
            f"play, {title} {PLAY_S:g} s: {rate:.1f} frames/s, {min(shown)} to {max(shown)} px wide, says '{says}'"
        )
    desk.key("space")
    time.sleep(0.5)
    return [*lines, *slow_turns(desk.log_lines(), began_s)]


def measure_answers(desk: Desk, title: str, seconds: float) -> list[str]:
    """Every kind of input at a calm pace: is each answered in time?"""
    since_s = time.monotonic()
    sent = drive(desk, seconds)
    time.sleep(0.5)
    log = desk.log_lines()
    answers = answer_times_ms(sent, log)
    lines = [row(f"{title}: answer to {kind}", times) for kind, times in answers.items()]
    every = [time_ms for times in answers.values() for time_ms in times]
    late = sum(time_ms > BUDGET_MS for time_ms in every)
    lines.append(row(f"{title}: all answers", every, target=f"{late} over {BUDGET_MS:.0f}, none wanted"))
    return [*lines, *slow_turns(log, since_s)]


def slow_turns(log: list[dict[str, Any]], since_s: float) -> list[str]:
    """What took long in the window's loop, and why."""
    lines = []
    slow = [line for line in log if "slow" in line and line["at_s"] >= since_s]
    for line in sorted(slow, key=lambda line: -line["wall_ms"])[:6]:
        lines.append(
            f"  {line['slow']} {line['wall_ms']:.0f} ms: computed {line['computed_ms']:.0f}, waited for a core "
            f"{line['waited_for_a_core_ms']:.0f}; other threads computed {line['other_threads_computed_ms']:.0f}"
        )
        lines += [f"      {text[:230]}" for text in line["stacks"]]
        lines += [f"      beside it {text}" for text in line["others"] if "wait" not in text]
    return lines


# ---- sessions ------------------------------------------------------------------------------------------------


def with_desk(path: Path, work: Callable[[Desk], list[str]]) -> list[str]:
    """Open something in a window of its own and do something with it."""
    with tempfile.TemporaryDirectory() as name:
        for variable in ("XDG_DATA_HOME", "XDG_CONFIG_HOME"):
            os.environ[variable] = name
        desk = Desk(Path(name), [str(path.resolve())], size=SIZE)
        try:
            desk.wait_for("an open capture", lambda s: s["capture"] is not None and "timeline.track" in s["rects"], 60)
            desk.wait_for("something to look at", lambda s: s["shows"] != "Cameras only", 60)
            desk.focus()
            return work(desk)
        finally:
            desk.close()


def wait_for_picture(desk: Desk, timeout_s: float = 180.0) -> None:
    """Until a trained frame is there in full."""
    desk.wait_for("a trained picture", lambda s: s["shows"] == "Rendered" and not s["hud"]["pending"], timeout_s)


def calm(desk: Desk, parts: list[str], seconds: float) -> list[str]:
    """What can be measured in a window of a trained project."""
    wait_for_picture(desk)
    lines = measure_scrub(desk) if "scrub" in parts else []
    lines += measure_play(desk) if "play" in parts else []
    if "orbit" in parts:
        lines += measure_orbit(desk, "orbit", min(seconds, 8.0), ("40 median", "120 at p95"))
    lines += measure_answers(desk, "nothing trains", seconds) if "answers" in parts else []
    return lines


def train(desk: Desk, parts: list[str], options: argparse.Namespace) -> list[str]:
    """Idle, while a clip is prepared, and while it trains."""
    lines = measure_answers(desk, "nothing trains", options.seconds) if "answers" in parts else []
    if options.no_training:
        return lines
    desk.click("training.next")
    desk.wait_for("preparing", lambda s: s["training"]["state"] in ("preparing", "running"), options.steps_timeout)
    lines += measure_answers(desk, "a clip is prepared", options.seconds) if "answers" in parts else []
    desk.wait_for("training", lambda s: s["training"]["state"] == "running", options.steps_timeout)
    first = desk.state["clips"].index("training") if "training" in desk.state["clips"] else 0
    desk.key("Home")
    for _ in range(first):  # into the clip that trains
        desk.key("Down")
    wait_for_trained = options.steps_timeout
    desk.wait_for("a trained picture", lambda s: s["shows"] == "Rendered", wait_for_trained)
    if "orbit" in parts:
        lines += measure_orbit(desk, "a clip trains, orbit", min(options.seconds, 8.0), ("80 median", "120 at p95"))
    lines += measure_answers(desk, "a clip trains", options.seconds) if "answers" in parts else []
    lines.append(f"training is {desk.state['training']['state']} at the end")
    return lines


def main() -> int:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("path", type=Path, help="capture, or a project with trained clips")
    parser.add_argument("--seconds", type=float, default=30.0, help="of each kind of answers")
    parser.add_argument("--no-training", action="store_true")
    parser.add_argument("--parts", default=",".join(PARTS), help=f"some of {', '.join(PARTS)}")
    parser.add_argument("--steps-timeout", type=float, default=400.0, help="seconds to wait for the first step")
    options = parser.parse_args()
    parts = [part for part in options.parts.split(",") if part]
    if not set(parts) <= set(PARTS):
        parser.error(f"parts are {', '.join(PARTS)}")
    missing = missing_programs()
    if missing:
        print(f"not installed: {', '.join(missing)}")
        return 1
    print(HEADING)
    with tempfile.TemporaryDirectory() as name:
        if (options.path / "project.json").is_file():
            copy = Path(shutil.copytree(options.path, Path(name) / "project", ignore=shutil.ignore_patterns("*lock")))
            say(with_desk(copy, lambda desk: calm(desk, parts, options.seconds)))
            if not options.no_training:
                say(with_desk(copy, lambda desk: train(desk, parts, options)))
        else:
            for n in MADE if "orbit" in parts else ():
                folder = make_scene(Path(name) / f"made {n}", options.path, n)
                target = f"{40 if n <= MADE[0] else 80} median"
                title = f"orbit, {n:,} Gaussians"
                say(with_desk(folder, lambda desk, t=title, w=target: orbit_made(desk, t, w)))
            say(with_desk(options.path, lambda desk: train(desk, parts, options)))
    load = os.getloadavg()[0]
    print(f"\n{platform.platform()}, {os.cpu_count()} cores, load {load:.1f}, Python {platform.python_version()}")
    return 0


def orbit_made(desk: Desk, title: str, target: str) -> list[str]:
    """A made scene, dragged round."""
    wait_for_picture(desk)
    return measure_orbit(desk, title, 8.0, (target, "120 at p95"))


def say(lines: list[str]) -> None:
    """Print at once: the next part may take minutes."""
    print("\n".join(lines), flush=True)


if __name__ == "__main__":
    sys.exit(main())
