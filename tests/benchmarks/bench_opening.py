"""How long captures open and scrub: seconds and memory of 36 cameras and 1,400 frames, and of 10,000 frames.

    python -m tests.benchmarks.bench_opening out/opening [--cameras 36] [--frames 1400] [--long 10000] [--no-window]

Captures are made in the folder: images of one camera are links to one file, videos are real. Each is opened in a
process of its own; CPU time is what remains meaningful beside other work. The window is opened under Xvfb; its time
runs from starting the program until the timeline with all frames has been drawn, its memory is that of its process.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image

from app.lab.synthetic.rigs import make_rig
from app.lab.synthetic.writing import write_video
from tests.ui.desk import Desk, missing_programs

SIZE = (320, 240)
KINDS = ("panoptic", "pattern", "videos")
LOOK = """
import sys, time
import numpy as np
from app.background.memory import peak_bytes
from engine.capture.capture import open_capture
before = peak_bytes()
start, cpu = time.perf_counter(), time.process_time()
capture = open_capture(sys.argv[1], cache_bytes=512 << 20)
opened, opened_cpu, opened_bytes = time.perf_counter() - start, time.process_time() - cpu, peak_bytes()
generator = np.random.default_rng(0)
waits = []
for _ in range(int(sys.argv[2])):
    camera, frame = generator.integers(len(capture.rig)), generator.integers(capture.n_frames)
    start = time.perf_counter()
    capture.frame(int(camera), int(frame))
    waits.append(time.perf_counter() - start)
print(f"open {opened:.2f} s (CPU {opened_cpu:.2f} s), peak {before / 1e6:.0f} -> {opened_bytes / 1e6:.0f} MB; "
      f"{len(waits)} leaps: median {np.median(waits) * 1e3:.0f} ms, 95th percentile "
      f"{np.quantile(waits, 0.95) * 1e3:.0f} ms, peak {peak_bytes() / 1e6:.0f} MB")
"""


def make_capture(folder: Path, kind: str, n_cameras: int, n_frames: int) -> Path:
    """A capture of this kind, made once."""
    if (folder / "done").exists():
        return folder
    folder.mkdir(parents=True, exist_ok=True)
    rig = make_rig(n_cameras, SIZE)
    generator = np.random.default_rng(0)
    cameras = []
    for row, name in enumerate(rig.names):
        camera = {"name": name, "width": SIZE[0], "height": SIZE[1], "K": rig.Ks[row].tolist()}
        camera["world_to_camera"] = rig.world_to_camera[row].tolist()
        if kind == "videos":
            camera["video"] = f"{name}.mp4"
            write_video(folder / f"{name}.mp4", _pictures(generator, n_frames), fps=30.0, crf=30)
        else:
            camera["images"] = f"ims/{row}/*.jpg"
            _link_images(folder / "ims" / str(row), next(_pictures(generator, 1)), n_frames)
        cameras.append(camera)
    if kind == "panoptic":
        files = [[f"{row}/{frame:06d}.jpg" for row in range(n_cameras)] for frame in range(n_frames)]
        meta = {"w": SIZE[0], "h": SIZE[1], "k": [rig.Ks.tolist()] * n_frames, "fn": files}
        meta |= {"w2c": [rig.world_to_camera.tolist()] * n_frames, "cam_id": [list(range(n_cameras))] * n_frames}
        (folder / "train_meta.json").write_text(json.dumps(meta))
    else:
        (folder / "capture.json").write_text(json.dumps({"schema": 1, "fps": 30, "cameras": cameras}))
    (folder / "done").touch()
    return folder


def _pictures(generator: np.random.Generator, n_frames: int) -> Iterator[np.ndarray]:
    """Coloured blocks, of which one changes from frame to frame."""
    blocks = generator.uniform(0, 255, (SIZE[1] // 20, SIZE[0] // 20, 3))
    for _ in range(n_frames):
        blocks[generator.integers(len(blocks)), generator.integers(blocks.shape[1])] = generator.uniform(0, 255, 3)
        yield np.kron(blocks, np.ones((20, 20, 1))).astype(np.uint8)


def _link_images(folder: Path, picture: np.ndarray, n_frames: int) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    first = folder / "000000.jpg"
    Image.fromarray(picture).save(first)
    for frame in range(1, n_frames):
        os.link(first, folder / f"{frame:06d}.jpg")


def look(folder: Path, n_leaps: int) -> str:
    """Open a capture in a process of its own, and ask for pictures at random."""
    command = [sys.executable, "-c", LOOK, str(folder), str(n_leaps)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


def look_in_window(folder: Path, work: Path, n_frames: int) -> str:
    """Open a capture in the window, then scrub through it."""
    work.mkdir(parents=True, exist_ok=True)
    start = time.monotonic()
    desk = Desk(work, [str(folder)])
    try:
        desk.wait_for("a window", lambda state: bool(state), 120)
        shown_s = time.monotonic() - start
        desk.wait_for(
            "all frames", lambda state: state["n_frames"] == n_frames and "timeline.track" in state["rects"], 120
        )
        opened_s = time.monotonic() - start
        opened = _memory(desk.program.pid)
        x0, y0, x1, y1 = desk.state["rects"]["timeline.track"]
        desk.drag((x0 + 10, (y0 + y1) / 2), (x1 - 10, (y0 + y1) / 2), steps=60)
        time.sleep(3)
        return (
            f"window {shown_s:.2f} s, cameras and timeline {opened_s:.2f} s after the start; "
            f"{opened} then, after scrubbing {_memory(desk.program.pid)}"
        )
    finally:
        desk.close()


def _memory(pid: int) -> str:
    """Memory of a process, as the kernel counts it: resident, and what of it belongs to no file."""
    status = Path(f"/proc/{pid}/status").read_text()
    values = {line.split(":")[0]: int(line.split()[1]) / 1000 for line in status.splitlines() if "kB" in line}
    return f"{values['VmRSS']:.0f} MB ({values['RssAnon']:.0f} without mapped libraries)"


def main() -> int:
    """Make, open, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--cameras", type=int, default=36)
    parser.add_argument("--frames", type=int, default=1400)
    parser.add_argument("--long", type=int, default=10_000, help="frames of the long capture, of four cameras")
    parser.add_argument("--leaps", type=int, default=300)
    parser.add_argument("--no-window", action="store_true")
    options = parser.parse_args()
    has_window = not options.no_window and not missing_programs()
    for kind in KINDS:
        for n_cameras, n_frames in ((options.cameras, options.frames), (4, options.long)):
            folder = make_capture(options.folder / f"{kind}-{n_frames}", kind, n_cameras, n_frames)
            print(f"{kind}, {n_cameras} cameras x {n_frames:,}: {look(folder, options.leaps)}", flush=True)
            if has_window:
                print(f"  {look_in_window(folder, options.folder / 'desk', n_frames)}", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
