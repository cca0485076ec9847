"""How long until a heat map is there? Cold, after a leap of the playhead, and warm, at the same places again.

    python -m tests.benchmarks.bench_heat PROJECT [--kind E] [--jumps 24]

Through a session without a window: what is timed is the map's values, not their drawing. The first map, for which
libraries and clips are loaded, is printed by itself.
"""

from __future__ import annotations

import argparse
import shutil
import statistics
import tempfile
import time
from pathlib import Path

from app.residuals.heat_map import HEAT_KINDS
from app.session.projects.project_commands import OpenProject
from app.session.projects.settings import Settings
from app.session.session import Session
from app.session.showing.look_commands import LookThrough, SetFrame
from engine.kernels.cache import use_kernel_cache

POLL_S = 0.001
TIMEOUT_S = 120.0


def wait_ms(session: Session, kind: str) -> float:
    """Milliseconds until the map of the playhead is there."""
    began_s = time.perf_counter()
    while True:
        heat = session.heat(kind)
        if heat is not None and not heat.is_stale:
            return (time.perf_counter() - began_s) * 1e3
        if time.perf_counter() - began_s > TIMEOUT_S:
            raise TimeoutError(f"no heat map: {list(session.notices)}")
        session.poll()
        time.sleep(POLL_S)


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("project", type=Path)
    parser.add_argument("--kind", choices=list(HEAT_KINDS), default="E")
    parser.add_argument("--jumps", type=int, default=24)
    options = parser.parse_args()
    use_kernel_cache()
    with tempfile.TemporaryDirectory() as name:
        copy = shutil.copytree(options.project, Path(name) / "project", ignore=shutil.ignore_patterns("*lock"))
        session = Session(settings=Settings(Path(name) / "settings.json"), is_preloading=False)
        session.dispatch(OpenProject(Path(copy)))
        while session.capture is None:
            session.poll()
            time.sleep(POLL_S)
        n_frames, n_cameras = session.timeline.n_frames, len(session.rig)
        session.dispatch(SetFrame(1))
        session.dispatch(LookThrough(0))
        print(f"first map {wait_ms(session, options.kind):.0f} ms")
        for title in ("cold", "warm"):
            times = []
            for jump in range(options.jumps):
                session.dispatch(SetFrame(1 + (7 * jump) % (n_frames - 1)))
                session.dispatch(LookThrough((3 * jump + 1) % n_cameras))
                times.append(wait_ms(session, options.kind))
            times.sort()
            p95 = times[min(round(0.95 * len(times)), len(times) - 1)]
            print(
                f"{title}: median {statistics.median(times):.0f} ms, 95th percentile {p95:.0f}, slowest {times[-1]:.0f}"
            )
        session.close()


if __name__ == "__main__":
    main()
