"""Speed of the CPU rasterizer beside its error, as one table.

    python -m tests.benchmarks.bench_raster
    python -m tests.benchmarks.bench_raster --scenes small,heavy --runs 30 --json raster.json

Milliseconds are medians (and minima) of one forward and one backward pass of everything, 2D means included, after a
warm-up. Brute force in float64 cannot render the large scenes, so every row also renders the same recipe at 80x60:
there the error is measured and the speed compared with the reference in the same run.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import platform
import statistics
import time
from datetime import date
from pathlib import Path

import numba
import torch

from engine.raster import Gaussians, Rendering, rasterize
from engine.raster.cpu import configure_threads, warm_up
from engine.raster.rasterize import BackendName
from tests.raster_scenes import Scene, gradients, layered_scene


@dataclasses.dataclass(frozen=True)
class Recipe:
    """Arguments of `layered_scene`."""

    n_rows: int
    width: int
    height: int
    size_px: float
    faint: bool = False

    def scene(self) -> Scene:
        return layered_scene(self.n_rows, self.width, self.height, self.size_px, faint=self.faint)

    def reduced(self) -> Recipe:
        """The same overlap per pixel at 80x60."""
        n_rows = max(100, self.n_rows * 80 * 60 // (self.width * self.height))
        return dataclasses.replace(self, n_rows=n_rows, width=80, height=60)


RECIPES = {
    "accuracy": Recipe(2_000, 160, 120, 3.5),
    "small": Recipe(10_000, 320, 240, 3.2),
    "heavy": Recipe(20_000, 320, 240, 9.0, faint=True),
    "medium": Recipe(50_000, 640, 480, 3.2),
    "large": Recipe(200_000, 1280, 720, 3.0),
}
"""Sizes of the measurements that chose the design: median splat 3 px, or 9 px and faint."""


def render(scene: Scene, dtype: torch.dtype, backend: BackendName) -> tuple[Gaussians, Rendering, float, float]:
    """Leaves with gradients, rendering, forward and backward milliseconds."""
    leaves = Gaussians(*(tensor.to(dtype).clone().requires_grad_() for tensor in scene.gaussians.tensors()))
    background = scene.background.to(dtype)
    generator = torch.Generator().manual_seed(0)
    shape = (1, scene.height, scene.width, 3)
    upstream = torch.randn(shape, generator=generator, dtype=torch.float64).to(dtype)
    started = time.perf_counter()
    rendering = rasterize(leaves, *scene.arguments, background=background, backend=backend, want_means2d=True)
    middle = time.perf_counter()
    rendering.image.backward(upstream)
    return leaves, rendering, (middle - started) * 1e3, (time.perf_counter() - middle) * 1e3


def timings(scene: Scene, n_runs: int) -> tuple[list[float], list[float]]:
    """Forward and backward milliseconds of every run after two that warm up."""
    runs = [render(scene, torch.float32, "cpu")[2:] for _ in range(n_runs + 2)][2:]
    return [forward for forward, _ in runs], [backward for _, backward in runs]


def errors(scene: Scene) -> tuple[float, float, float]:
    """Largest pixel error, largest relative gradient error, and how much slower the float32 reference is."""
    exact, expected, _, _ = render(scene, torch.float64, "reference")
    actual_leaves, actual, *_ = render(scene, torch.float32, "cpu")
    pixel = (actual.image - expected.image).abs().max().item()
    pairs = zip(gradients(actual_leaves), gradients(exact), strict=True)
    gradient = max(((a - b).norm() / b.norm()).item() for a, b in pairs)
    reference_ms = sum(render(scene, torch.float32, "reference")[2:])
    forward, backward = timings(scene, 5)
    return pixel, gradient, reference_ms / (statistics.median(forward) + statistics.median(backward))


def measure(name: str, n_runs: int) -> dict[str, float | str]:
    """One row of the table."""
    recipe = RECIPES[name]
    forward, backward = timings(recipe.scene(), n_runs)
    checked = recipe if name == "accuracy" else recipe.reduced()
    pixel, gradient, ratio = errors(checked.scene())
    return {
        "scene": name,
        "n_gaussians": recipe.n_rows,
        "width": recipe.width,
        "height": recipe.height,
        "forward_ms": statistics.median(forward),
        "backward_ms": statistics.median(backward),
        "forward_min_ms": min(forward),
        "backward_min_ms": min(backward),
        "checked_at": f"{checked.n_rows} {checked.width}x{checked.height}",
        "pixel_error": pixel,
        "gradient_error": gradient,
        "reference_ratio": ratio,
    }


def main(argv: list[str] | None = None) -> None:
    """Print the table; see the module docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", default=",".join(RECIPES), help="comma-separated names")
    parser.add_argument("--runs", type=int, default=15)
    parser.add_argument("--threads", type=int, default=None)
    parser.add_argument("--json", type=Path, help="also write the rows here")
    options = parser.parse_args(argv)

    n_threads = configure_threads(options.threads)
    started = time.perf_counter()
    warm_up()
    about = {
        "date": date.today().isoformat(),
        "machine": platform.processor() or platform.machine(),
        "threads": n_threads,
        "python": platform.python_version(),
        "torch": torch.__version__,
        "numba": numba.__version__,
        "warm_up_s": round(time.perf_counter() - started, 2),
    }
    print(", ".join(f"{key} {value}" for key, value in about.items()))
    print(
        f"{'scene':9s} {'gaussians':>9s} {'image':>9s} {'forward ms':>15s} {'backward ms':>15s} "
        f"{'checked at':>12s} {'pixel':>8s} {'gradient':>8s} {'reference':>9s}"
    )
    rows = []
    for name in options.scenes.split(","):
        row = measure(name, options.runs)
        rows.append(row)
        print(
            f"{name:9s} {row['n_gaussians']:9d} {row['width']:4d}x{row['height']:<4d} "
            f"{row['forward_ms']:7.1f} ({row['forward_min_ms']:5.1f}) {row['backward_ms']:7.1f} "
            f"({row['backward_min_ms']:5.1f}) {row['checked_at']:>12s} {row['pixel_error']:8.1e} "
            f"{row['gradient_error']:8.1e} {row['reference_ratio']:8.0f}x",
            flush=True,
        )
    if options.json:
        options.json.write_text(json.dumps({"about": about, "rows": rows}, indent=2) + "\n")


if __name__ == "__main__":
    main()
