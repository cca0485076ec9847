"""What each part saves in a step of a source clip, one after the other, on a real capture.

    python -m tests.benchmarks.bench_source_step                       # the shipped sample
    python -m tests.benchmarks.bench_source_step PATH --holdout 0,10 --runs 40 --json parts.json

From the published scheme (its sizes, every anchor through the field at every time, all tiles, decode in plain torch) to
the defaults. Each scheme gets a reference clip of a few steps and a source clip over it; then all of them train in
turn, a step each, so that a busy machine hits them alike. Only time is measured: `clipgstream ablate --source-steps`
measures what is learned in it.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from app.background.kernels import use_threads
from app.lab.ablation.variants import variant_called
from app.lab.bench.timing import Timing, interleaved
from engine.assets import asset_path
from engine.backends.cpu.backend import CpuBackend
from engine.backends.reference.decode import decode_reference
from engine.backends.table import backend_called
from engine.capture.capture import Capture, open_capture
from engine.capture.clip import Clip, split_clips
from engine.raster.gaussians import Gaussians
from engine.training.clip_training import ClipTraining
from engine.training.config import TrainConfig
from engine.training.variants.variant_method import method_of
from tests.benchmarks.options import ending_on_bad_input

SCHEMES = {
    "published, decode in torch": "published",
    "+ fused decode": "published",
    "+ static gate": "published-static",
    "+ gate in time": "published-gate",
    "+ active tiles": "published-tiles",
    "+ own sizes": "full",
}
"""What is added, and the variant that has it."""
IN_TORCH = "published, decode in torch"
REFERENCE_STEPS: dict[str, Any] = {"static_steps": 150, "joint_steps": 150}
"""Enough that Gaussians have found sizes and opacities on which the time of a step depends."""
N_WARM = 5


class DecodeInTorch(CpuBackend):
    """The kernels, but the decode in plain torch."""

    def decode(self, *arguments: Any, **options: Any) -> Gaussians:
        return decode_reference(*arguments, **options)


IN_TORCH_BACKEND = DecodeInTorch()


@dataclass(frozen=True, slots=True)
class Part:
    """One scheme: its step, and the number of Gaussians in the last one."""

    name: str
    timing: Timing
    n_gaussians: int


def make_source(capture: Capture, clips: list[Clip], holdout: list[int], overrides: dict[str, Any]) -> ClipTraining:
    """A source clip, prepared, over a reference clip of a few steps."""
    with tempfile.TemporaryDirectory() as folder:
        make = partial(
            ClipTraining,
            capture,
            config=(config := TrainConfig(**(overrides | REFERENCE_STEPS))),
            method=method_of(config, previous=None),
            backend=backend_called("cpu"),
            holdout=holdout,
            seed=0,
            prep_dir=Path(folder),
            report=lambda _: None,
        )
        reference = make(clips[0], reference=None)
        reference.prepare()
        while not reference.is_finished:
            reference.step()
        source = make(clips[1], reference=reference.state())
        source.prepare()
    return source


def measure(capture: Capture, *, holdout: list[int], clip_length: int, n_runs: int) -> list[Part]:
    """Milliseconds of a step of every scheme, in turn."""
    clips = split_clips(capture.n_frames, clip_length)
    sources: dict[str, ClipTraining] = {}
    n_gaussians: dict[str, int] = {}
    for name in dict.fromkeys(SCHEMES.values()):
        print(f"preparing {name}", file=sys.stderr)
        variant = variant_called(name)
        assert variant is not None
        sources[name] = make_source(capture, clips, holdout, variant.overrides)

    def step(name: str) -> tuple[float]:
        source = sources[SCHEMES[name]]
        source.model.backend = IN_TORCH_BACKEND if name == IN_TORCH else source.backend
        started = time.perf_counter()
        n_gaussians[name] = source.step().n_gaussians
        return ((time.perf_counter() - started) * 1e3,)

    timings = interleaved({name: partial(step, name) for name in SCHEMES}, n_runs, n_warm=N_WARM)
    return [Part(name, timings[name][0], n_gaussians[name]) for name in SCHEMES]


def table(parts: list[Part]) -> str:
    """One line per scheme: time, and how many times faster than the line above and than the first."""
    lines = [f"{'step of a source clip':<28}{'median ms':>10}{'min ms':>9}{'Gaussians':>11}{'x':>7}{'x in all':>10}"]
    for index, part in enumerate(parts):
        before = parts[max(index - 1, 0)].timing.median_ms / part.timing.median_ms
        first = parts[0].timing.median_ms / part.timing.median_ms
        lines.append(
            f"{part.name:<28}{part.timing.median_ms:>10.1f}{part.timing.min_ms:>9.1f}{part.n_gaussians:>11,}"
            f"{before:>7.2f}{first:>10.1f}"
        )
    return "\n".join(lines)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", nargs="?", type=Path, default=asset_path("sample"), help="default: the sample")
    parser.add_argument("--holdout", help="camera names separated by commas; by default those of the capture")
    parser.add_argument("--clip-length", type=int, default=10, metavar="M")
    parser.add_argument("--runs", type=int, default=30, help="steps of each that count")
    parser.add_argument("--json", type=Path, help="also write the figures here")
    options = parser.parse_args()
    use_threads(None)
    with ending_on_bad_input():
        capture = open_capture(options.capture)
        names = list(capture.default_holdout) if options.holdout is None else options.holdout.split(",")
        holdout = capture.camera_indices(names)
    parts = measure(capture, holdout=holdout, clip_length=options.clip_length, n_runs=options.runs)
    print(table(parts))
    if options.json:
        rows = [
            {
                "scheme": part.name,
                "median_ms": part.timing.median_ms,
                "min_ms": part.timing.min_ms,
                "n_gaussians": part.n_gaussians,
            }
            for part in parts
        ]
        options.json.write_text(json.dumps({"schema": 1, "rows": rows}, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
