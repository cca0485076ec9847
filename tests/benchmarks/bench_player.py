"""The streaming player in Chromium: its size, how soon it shows something, how fast it seeks, and how exact it is.

    python -m tests.benchmarks.bench_player PROJECT [--page scene.html]

The page and its folder are exported, unless --page names one that was, and served with ranges. The line is throttled to
10 Mbit/s with 40 ms of latency by the browser. Pictures at 640x480 are compared with the CPU rasterizer's of the
Gaussians before any rounding, from the first view and from cameras of the capture. For memory the clips are repeated
until they are 2,000 frames, and the playhead leaps through them. The browser draws in software.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch

from app.background.kernels import use_threads
from app.evaluation.headless import TrainedProject, open_trained
from app.export.edits.written_edits import written_edits
from app.export.jobs.player import PlayerJob
from app.export.player_job import run
from app.export.scene_frames import SceneFrames
from app.playback.modes.arrays import BACKGROUND
from app.project.opening.project_access import open_project
from engine.raster import rasterize
from tests.benchmarks.options import ending_on_bad_input
from tests.browser import Browser
from tests.documents.table import table
from tests.range_server import RangeServer

SIZE = (640, 480)
LINE = {"offline": False, "latency": 40, "downloadThroughput": 10e6 / 8, "uploadThroughput": 10e6 / 8}
N_STARTS, N_SEEKS, N_LEAPS, LONG_FRAMES = 3, 10, 40, 2000
SETTLED = (
    "(p => p && p.isDrawn && p.share === 1 && p.onScreen === p.clock.frame && !p.pictures.isBusy"
    " && p.pictures.answered === p.pictures.wish.key && !p.pictures.loader.running.size"
    " && p.pictures.loaded.get(p.pictures.clipOf(p.stored(p.clock.frame))) === 3)(window.clipgstreamPlayer)"
)
WATCH = """
(function look() {
  const player = window.clipgstreamPlayer;
  if (player && player.onScreen !== null) window.firstMs = performance.now();
  else setTimeout(look, 2);
})();
"""
SEEK = """new Promise((done) => {
  const player = clipgstreamPlayer, begun = performance.now();
  player.go(%d);
  let ready = null;
  const look = () => {
    if (ready === null && player.shown === player.clock.frame) ready = performance.now() - begun;
    if (player.onScreen === player.clock.frame) done([ready, performance.now() - begun]);
    else setTimeout(look, 1);
  };
  look();
})"""


def go_to(browser: Browser, url: str) -> None:
    """Open a page anew, with nothing in the cache."""
    browser.call("Page.navigate", url="about:blank")
    browser.call("Network.clearBrowserCache")
    browser.call("Page.navigate", url=url)


def starts(browser: Browser, url: str) -> list[float]:
    """Milliseconds from the navigation to the first picture, several times."""
    found = []
    for _ in range(N_STARTS):
        go_to(browser, url)
        browser.wait("window.firstMs !== undefined")
        found.append(float(browser.value("firstMs")))
    return found


def seeks(browser: Browser, n_frames: int) -> np.ndarray:
    """Milliseconds from a leap to a loaded frame until it can be drawn, and until it is on the screen. [n, 2]"""
    frames = np.random.default_rng(0).permutation(n_frames)[:N_SEEKS]
    return np.array([browser.value(SEEK % frame) for frame in frames.tolist()])


def exactness(browser: Browser, opened: TrainedProject, job: PlayerJob, n_frames: int) -> list[float]:
    """PSNR of the page's pictures against the rasterizer's, dB."""
    scene = SceneFrames(opened, edits=written_edits(opened.project.document, job))
    near, n_cameras = browser.value("clipgstreamPlayer.header.near_plane"), len(opened.rig)
    found = []
    for number, camera in enumerate([None, *np.linspace(0, n_cameras - 1, 6).astype(int).tolist()]):
        frame = number * (n_frames - 1) // 6
        chosen = "null, true" if camera is None else str(camera)
        browser.value(f"void clipgstreamPlayer.go({frame}); void clipgstreamPlayer.look({chosen})")
        browser.wait(SETTLED, timeout_s=120.0)
        browser.value("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
        lens = browser.value(f"clipgstreamPlayer.view.lens({SIZE[0]}, {SIZE[1]})")
        (fx, fy), (cx, cy) = lens["focal"], lens["center"]
        with torch.no_grad():
            image = rasterize(
                scene.gaussians(scene.trained_frames[frame]),
                torch.tensor(lens["worldToCamera"]).reshape(1, 4, 4),
                torch.tensor([[[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]]),
                *SIZE,
                backend=opened.backend,
                near_plane=near,
                background=torch.tensor(BACKGROUND, dtype=torch.float32),
            ).image[0]
        error = browser.picture()[: SIZE[1]] / 255.0 - image.clamp(0.0, 1.0).numpy()
        found.append(float(-10.0 * np.log10(np.mean(error**2))))
    return found


def lengthened(page: Path) -> Path:
    """The same page with its clips again and again, from the same files."""
    text = page.read_text(encoding="utf-8")
    found = re.search(r'id="header">([^<]*)<', text)
    assert found is not None
    header = json.loads(found[1])
    clips, first = [], 0
    while first < LONG_FRAMES:
        for clip in header["clips"]:
            clips.append({**clip, "first": first, "clip_index": len(clips)})
            first += len(clip["moving"]["n"])
    header["clips"] = clips
    long = page.with_name("long.html")
    long.write_text(text[: found.start(1)] + json.dumps(header) + text[found.end(1) :], encoding="utf-8")
    return long


def memory_mb(browser: Browser) -> float:
    """Of the browser's process that runs the page, resident, MB: the largest of its processes."""
    return max(_resident(pid) for pid in _group(browser.pid)) / 1e6


def _group(leader: int) -> list[int]:
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[2]) == leader:
            found.append(int(path.parent.name))
    return found


def _resident(pid: int) -> float:
    try:
        return next(
            1024.0 * float(line.split()[1])
            for line in Path(f"/proc/{pid}/status").read_text().splitlines()
            if line.startswith("RssAnon")
        )
    except (OSError, StopIteration):
        return 0.0


def scrubbed(browser: Browser, url: str) -> tuple[float, float, int]:
    """Leap through a long scene. Returns the memory before, MB, the most since, and how many clips are held then."""
    browser.resize(160, 160)  # drawing in software would take most of the time
    go_to(browser, url)
    browser.wait("window.clipgstreamPlayer?.onScreen === 0", timeout_s=60.0)
    browser.value("void (clipgstreamPlayer.pictures.quality = 'low')")
    before = most = memory_mb(browser)
    n_held = 0
    frames = np.random.default_rng(1).integers(browser.value("clipgstreamPlayer.clock.nFrames"), size=N_LEAPS)
    for frame in frames.tolist():
        browser.value(SEEK % frame)
        most, n_held = (
            max(most, memory_mb(browser)),
            max(n_held, browser.value("clipgstreamPlayer.pictures.loaded.size")),
        )
    return before, most, n_held


def main() -> int:
    """Export, serve, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("project", type=Path)
    parser.add_argument("--page", type=Path, help="exported before, with its folder")
    options = parser.parse_args()
    use_threads(1)
    rows: list[tuple[str, str, str]] = []
    with ending_on_bad_input(), tempfile.TemporaryDirectory() as name:
        opened = open_trained(open_project(options.project, is_writable=False))
        job = PlayerJob(options.page or Path(name) / "scene.html", has_folder=True)
        if options.page is None:
            run(opened, job, lambda progress: None)
        (Path(name) / "chromium").mkdir()
        with Browser(Path(name) / "chromium") as browser, RangeServer(job.out.parent) as server:
            rows += _measured(browser, server, opened, job)
    print(table(("what", "measured", "target"), rows))
    return 0


def _measured(
    browser: Browser, server: RangeServer, opened: TrainedProject, job: PlayerJob
) -> list[tuple[str, str, str]]:
    sizes = {path.stem: path.stat().st_size for path in job.folder.glob("*.bin")}
    once, page = sizes.pop("shared"), job.out.stat().st_size
    url = server.url(job.out.name)
    browser.resize(*SIZE)
    browser.call("Network.emulateNetworkConditions", **LINE)
    browser.call("Page.addScriptToEvaluateOnNewDocument", source=WATCH)
    first = starts(browser, url)
    _say(f"first picture {first}")
    n_frames = int(browser.value("clipgstreamPlayer.clock.nFrames"))
    per_frame = sum(sizes.values()) / n_frames
    browser.wait(SETTLED, timeout_s=120.0)
    time.sleep(5.0)  # what comes next is loaded meanwhile
    sought = seeks(browser, n_frames)
    _say(f"seeks {sought.tolist()}")
    browser.call("Network.emulateNetworkConditions", **{**LINE, "latency": 0, "downloadThroughput": -1})
    bar: Any = browser.value("document.querySelector('footer').offsetHeight")
    browser.resize(SIZE[0], SIZE[1] + bar)
    browser.value("void (document.querySelector('header').hidden = true)")
    psnr = exactness(browser, opened, job, n_frames)
    _say(f"PSNR {psnr}")
    before, most, n_held = scrubbed(browser, server.url(lengthened(job.out).name))
    return [
        ("frames", str(n_frames), ""),
        ("page with its poster, kB", f"{page / 1e3:.0f}", ""),
        ("what stands still, kB", f"{once / 1e3:.0f}", ""),
        ("each frame, kB", f"{per_frame / 1e3:.1f}", ""),
        ("150 frames, MB", f"{(page + once + 150 * per_frame) / 1e6:.1f}", "15"),
        ("PSNR against the rasterizer, dB: mean, least", f"{np.mean(psnr):.1f}, {min(psnr):.1f}", "45"),
        ("first picture, 10 Mbit/s and 40 ms, ms: median, most", _ms(first), "1,000"),
        ("seek, until it can be drawn, ms: median, most", _ms(sought[:, 0]), "150"),
        ("seek, until it is drawn in software, ms: median, most", _ms(sought[:, 1]), "150"),
        (
            f"memory of the page over {N_LEAPS} leaps through {LONG_FRAMES:,} frames, MB: before, most; clips held",
            f"{before:.0f}, {most:.0f}; {n_held}",
            "",
        ),
    ]


def _ms(values: list[float] | np.ndarray) -> str:
    return f"{np.median(values):.0f}, {np.max(values):.0f}"


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


if __name__ == "__main__":
    raise SystemExit(main())
