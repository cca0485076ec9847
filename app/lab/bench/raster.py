"""The rasterizer: forward and backward pass at full size, error and lead over plain torch at a size torch can do.

Brute force (every Gaussian against every pixel) cannot render the large scenes, so those are checked in a picture of
80 x 60 with the same overlap per pixel.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import torch
from torch import Tensor

from app.lab.bench.compared import COMPARED, EXACT, FAST
from app.lab.bench.rows import KernelRow, SpeedError, kernel_row
from app.lab.bench.scenes import RECIPES, Recipe
from app.lab.bench.timing import interleaved, peak_extra_mb
from app.lab.synthetic.gaussian_scenes import GaussianScene
from engine.raster import Gaussians, Rendering, rasterize
from engine.raster.rasterizer import Rasterizer

FORWARD_OPERATIONS, BACKWARD_OPERATIONS = 20, 43
"""Instructions on the multiply-add ports per block of sixteen pairs, counted in the two inner loops: exponent 3,
exponential 8, comparisons, colours and the rest; backward the same again and nine sums."""
N_CHECK_RUNS = 3


@dataclass(frozen=True, slots=True)
class Pass:
    """One forward and backward pass: leaves with gradients, the picture, milliseconds of each."""

    leaves: Gaussians
    rendering: Rendering
    forward_ms: float
    backward_ms: float


def run_pass(scene: GaussianScene, dtype: torch.dtype, backend: Rasterizer) -> Pass:
    """Draw a scene and differentiate everything, 2D means included, against a fixed random upstream gradient."""
    leaves = Gaussians(*(tensor.to(dtype).clone().requires_grad_() for tensor in scene.gaussians.tensors()))
    background = scene.background.to(dtype)
    generator = torch.Generator().manual_seed(0)
    shape = (1, scene.height, scene.width, 3)
    upstream = torch.randn(shape, generator=generator, dtype=torch.float64).to(dtype)
    started = time.perf_counter()
    rendering = rasterize(leaves, *scene.arguments, background=background, backend=backend, want_means2d=True)
    middle = time.perf_counter()
    rendering.image.backward(upstream)
    return Pass(leaves, rendering, (middle - started) * 1e3, (time.perf_counter() - middle) * 1e3)


def evaluated_pairs(scene: GaussianScene) -> int:
    """(pixel, Gaussian) evaluations of a scene: sixteen for every 4x4 block that a Gaussian of a tile changes."""
    leaves = Gaussians(*(tensor.float().requires_grad_() for tensor in scene.gaussians.tensors()))
    image = rasterize(leaves, *scene.arguments, backend=FAST).image
    waiting: list[Any] = [image.grad_fn]
    while waiting:
        node = waiting.pop()
        drawing = getattr(node, "drawing", None)  # kept by the fast back end for its backward pass
        if drawing is not None:
            n_pairs = int(drawing.tile_starts[-1])
            return 16 * int(np.bitwise_count(drawing.pair_blocks[:n_pairs].view(np.uint64)).sum(dtype=np.int64))
        waiting += [earlier for earlier, _ in getattr(node, "next_functions", ()) if earlier is not None]
    raise LookupError("the fast back end left no drawing in the graph of its picture")


def relative_errors(actual: list[Tensor], expected: list[Tensor]) -> float:
    """Largest |a - b| / |b| over pairs of tensors; pairs whose truth is zero are left out."""
    pairs = [(a.double(), b) for a, b in zip(actual, expected, strict=True) if b.norm() > 0]
    return max(((a - b).norm() / b.norm()).item() for a, b in pairs)


def measure_raster(
    name: str, *, n_runs: int, has_memory: bool, recipe: Recipe | None = None
) -> tuple[KernelRow, list[SpeedError]]:
    """One scene.

    Args:
        name: A name of RECIPES, or any with `recipe`.
        n_runs: Runs that count at full size.
        has_memory: Also measure peak memory, in a separate process.
    Returns:
        The row of the table, and the marks of the chart.
    """
    recipe = recipe or RECIPES[name]
    scene = recipe.scene()
    (forward, backward), *_ = interleaved({"cpu": lambda: _stages(scene, FAST)}, n_runs).values()
    checked = recipe.reduced()
    checked_at = f"{checked.n_rows} in {checked.width}x{checked.height}"
    marks = _check(name, checked_at, checked.scene())
    row = kernel_row(
        marks,
        (forward, backward),
        size=f"{recipe.n_rows} in {recipe.width}x{recipe.height}",
        peak_mb=peak_extra_mb(prepare_memory, recipe) if has_memory else None,
        pairs=evaluated_pairs(scene),
    )
    return row, list(marks.values())


def limit_shares(row: KernelRow, fma_per_s: float) -> tuple[float, float] | None:
    """Share of the multiply-add limit that the forward and the backward pass reach; None where there are no pairs.

    The whole pass counts, with projection, sorting and binning; the limit is that of the inner loops alone.
    """
    if row.forward_pairs_per_s is None or row.backward_pairs_per_s is None:
        return None
    per_operation = 1 / 16 / fma_per_s
    return (
        row.forward_pairs_per_s * FORWARD_OPERATIONS * per_operation,
        row.backward_pairs_per_s * BACKWARD_OPERATIONS * per_operation,
    )


def prepare_memory(recipe: Recipe) -> Callable[[], object]:
    """For `peak_extra_mb`: kernels loaded, tensors made; the call is one forward and backward pass."""
    from engine.backends.cpu.raster.warm import warm_up
    from engine.kernels.threads import configure_threads

    configure_threads()
    warm_up()

    def ready(scene: GaussianScene) -> Callable[[], object]:
        leaves = Gaussians(*(tensor.float().requires_grad_() for tensor in scene.gaussians.tensors()))
        upstream = torch.ones(1, scene.height, scene.width, 3)

        def call() -> object:
            image = rasterize(leaves, *scene.arguments, backend=FAST, want_means2d=True).image
            image.backward(upstream)
            return image

        return call

    ready(RECIPES["accuracy"].scene())()  # memory that torch and the threads keep after their first real work
    return ready(recipe.scene())


def _stages(scene: GaussianScene, backend: Rasterizer) -> tuple[float, float]:
    done = run_pass(scene, torch.float32, backend)
    return done.forward_ms, done.backward_ms


def _check(name: str, size: str, scene: GaussianScene) -> dict[str, SpeedError]:
    """Both back ends in float32 compared with float64 brute force."""
    exact = run_pass(scene, torch.float64, EXACT)
    candidates = {path: partial(_stages, scene, backend) for path, backend in COMPARED.items()}
    timings = interleaved(candidates, N_CHECK_RUNS, n_warm=1)
    marks = {}
    for path, backend in COMPARED.items():
        done = run_pass(scene, torch.float32, backend)
        marks[path] = SpeedError(
            operation="raster",
            scene=name,
            size=size,
            backend=path,
            total_ms=sum(stage.median_ms for stage in timings[path]),
            value_error=(done.rendering.image - exact.rendering.image).abs().max().item(),
            gradient_error=relative_errors(_gradients(done), _gradients(exact)),
        )
    return marks


def _gradients(done: Pass) -> list[Tensor]:
    tensors = [*done.leaves.tensors(), done.rendering.means2d]
    return [tensor.grad for tensor in tensors if tensor is not None and tensor.grad is not None]
