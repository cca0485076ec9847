"""How fast does the exported player draw without a graphics card, and how alike are the ways in which it can?

    python -m tests.benchmarks.bench_drawing PROJECT [--clip 0] [--seconds 4]

Exports a frame as a page and turns the view in a headless Chromium whose graphics card is played by the processor: as
WebGL draws it, as WebGPU does, and as the worker paints it, which is what such a browser gets. "core ms" is the time of
all of the browser's processes on all cores for a picture, which other work on the machine changes little.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from pathlib import Path

import numpy as np

from app.background.kernels import use_threads
from app.evaluation.headless import open_trained
from app.export.jobs.player import PlayerJob
from app.export.picked_frames import PickedFrames
from app.export.player_job import run
from app.project.opening.project_access import open_project
from tests.benchmarks.options import ending_on_bad_input
from tests.browser import AS_A_CARD, AS_A_CARD_WITH_WEBGPU, WEBGPU_FLAGS, WITHOUT_WEBGPU, Browser
from tests.documents.table import table

SIZE = (640, 480)
WAYS = {
    "WebGL in software": ((), AS_A_CARD + WITHOUT_WEBGPU),
    "WebGPU in software": (WEBGPU_FLAGS, AS_A_CARD_WITH_WEBGPU),
    "painted by the worker": ((), ""),
}
SETTLED = (
    "(p => p && p.isDrawn && p.share === 1 && p.renderer.isDone() && p.pictures.answered === p.pictures.wish.key)"
    "(window.clipgstreamPlayer)"
)
COUNT = """(() => {
  const player = clipgstreamPlayer, { renderer } = player;
  const method = renderer.isSoftware ? "take" : "draw", act = renderer[method].bind(renderer);
  window.nPictures = 0;
  renderer[method] = (...all) => { nPictures++; act(...all); };
})()"""
TURN = """new Promise((done) => {
  const player = clipgstreamPlayer, until = performance.now() + 1000 * %f;
  const n = nPictures, begun = performance.now();
  const step = (nowMs) => {
    player.view.orbit(2, 0);
    player.moved();
    if (nowMs < until) requestAnimationFrame(step);
    else done([nPictures - n, (performance.now() - begun) / 1000]);
  };
  requestAnimationFrame(step);
})"""
IN_FULL = "void Object.defineProperty(clipgstreamPlayer, 'share', { get: () => 1, set: () => {} })"


def core_s(browser: Browser) -> float:
    """Processor time of the browser's processes until now, s."""
    ticks = 0
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:  # ended meanwhile
            continue
        if int(fields[2]) == browser.pid:
            ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def turned(browser: Browser, seconds: float) -> tuple[float, float]:
    """Pictures per second and core ms per picture while the view turns."""
    before = core_s(browser)
    n, took_s = browser.value(TURN % seconds)
    return n / took_s, 1000.0 * (core_s(browser) - before) / max(n, 1)


def main() -> None:
    """Command line; see the module docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("project", type=Path)
    parser.add_argument("--clip", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=4.0, help="of turning, for each figure")
    options = parser.parse_args()
    use_threads(None)
    rows = []
    first: np.ndarray | None = None
    with ending_on_bad_input(), tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        opened = open_trained(open_project(options.project, is_writable=False))
        clip = opened.clips[options.clip]
        job = PlayerJob(folder / "scene.html", frames=PickedFrames.of(range(clip.start, clip.start + 1)))
        run(opened, job, lambda progress: None)
        for number, (way, (flags, script)) in enumerate(WAYS.items()):
            (folder / str(number)).mkdir()
            with Browser(folder / str(number), flags=flags) as browser:
                browser.before_pages(script)
                browser.resize(SIZE[0], 800)
                browser.open(folder / "scene.html")
                browser.wait(SETTLED, timeout_s=120.0)
                bar = browser.value("document.querySelector('footer').offsetHeight")
                browser.resize(SIZE[0], SIZE[1] + bar)
                browser.value("void (document.querySelector('header').hidden = true)")
                browser.wait(f"clipgstreamPlayer.canvas.height === {SIZE[1]} && {SETTLED}", timeout_s=120.0)
                time.sleep(1.0)
                picture = browser.picture()[: SIZE[1]] / 255.0
                first = picture if first is None else first
                alike = -10.0 * np.log10(np.mean((picture - first) ** 2) + 1e-12)
                browser.value(COUNT)
                turned(browser, 2.0)  # until its code is compiled
                moving = turned(browser, options.seconds)
                browser.value(IN_FULL)
                turned(browser, 1.0)
                full = turned(browser, options.seconds)
                header = "clipgstreamPlayer.header"
                n = browser.value(
                    f"{header}.shared.n + ({header}.clips[0].own?.n ?? 0) + {header}.clips[0].moving.n[0]"
                )
                figures = [f"{value:.1f}" for pair in (moving, full) for value in pair]
                rows.append((way, str(n), *figures, "" if number == 0 else f"{alike:.1f}"))
    moving_and_full = ("turning, pictures/s", "core ms each", "in full, pictures/s", "core ms of these")
    print(table(("640x480", "Gaussians", *moving_and_full, "dB against WebGL"), rows))


if __name__ == "__main__":
    main()
