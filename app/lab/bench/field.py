"""The decode: hash grid, field network, heads and activations, fused against plain torch, error next to speed."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import torch
from torch import Tensor

from app.lab.bench.compared import COMPARED, EXACT, FAST
from app.lab.bench.raster import relative_errors
from app.lab.bench.rows import KernelRow, SpeedError, kernel_row
from app.lab.bench.timing import interleaved, peak_extra_mb
from engine.backends.backend import Backend
from engine.model.clip_model import ClipModel
from engine.model.decoding import decode_anchors
from engine.raster.gaussians import Gaussians
from engine.training.plan.synthetic_clip import ClipRecipe, chosen_anchors, make_clip

FRAME = 4
"""Frame of the clip that is decoded."""


@dataclass(frozen=True, slots=True)
class DecodeScene:
    """The scene to decode.

    Attributes:
        recipe: Sizes; the picture plays no part.
        has_field: Whether anchors have a dynamic feature; without it only heads and activations are left, so that the
            difference of two scenes is the share of grid and field network.
    """

    recipe: ClipRecipe
    has_field: bool = True


SCENES = {
    "2k": DecodeScene(ClipRecipe(2_000)),
    "8k": DecodeScene(ClipRecipe(8_000)),
    "8k heads": DecodeScene(ClipRecipe(8_000), has_field=False),
    "8k source": DecodeScene(ClipRecipe(8_000, is_source=True)),
    "50k": DecodeScene(ClipRecipe(50_000)),
    "50k heads": DecodeScene(ClipRecipe(50_000), has_field=False),
}
"""Anchors with five Gaussians each; "source" has frozen heads and half of the anchors without field."""


class DecodeRun:
    """One back end on one scene: a model with its own leaves and a fixed upstream gradient."""

    def __init__(self, scene: DecodeScene, backend: Backend) -> None:
        self.model: ClipModel = make_clip(scene.recipe, backend=backend)
        self._chosen = chosen_anchors(self.model, has_field=scene.has_field)
        self._field = self.model.field if scene.has_field else None
        self._upstream: list[Tensor] | None = None

    def __call__(self) -> tuple[float, float]:
        """One pass; milliseconds forward and backward."""
        self.model.zero_grad(set_to_none=True)
        started = time.perf_counter()
        gaussians = self.decode()
        middle = time.perf_counter()
        if self._upstream is None:
            generator = torch.Generator().manual_seed(0)
            shapes = [tensor.shape for tensor in gaussians.tensors()]
            self._upstream = [
                torch.randn(s, generator=generator, dtype=torch.float64).to(self.model.backend.dtype) for s in shapes
            ]
        pairs = zip(gaussians.tensors(), self._upstream, strict=True)
        learning = [(tensor, upstream) for tensor, upstream in pairs if tensor.requires_grad]
        begun = time.perf_counter()
        torch.autograd.backward([tensor for tensor, _ in learning], [upstream for _, upstream in learning])
        return (middle - started) * 1e3, (time.perf_counter() - begun) * 1e3

    def decode(self) -> Gaussians:
        """Gaussians of one frame."""
        return decode_anchors(
            self._chosen, self.model.decoder, self._field, self.model.knots(FRAME / 10), backend=self.model.backend
        )

    def gradients(self) -> dict[str, Tensor]:
        """Gradients of everything that learns and took part in the last pass, by name."""
        named = self.model.named_parameters()
        return {name: parameter.grad for name, parameter in named if parameter.grad is not None}


def measure_decode(
    name: str, *, n_runs: int, has_memory: bool, scene: DecodeScene | None = None
) -> tuple[KernelRow, list[SpeedError]]:
    """One scene: both back ends in turn, and both compared with float64.

    Args:
        name: A name of SCENES, or any with `scene`.
        n_runs: Runs that count.
        has_memory: Also measure peak memory, in a separate process.
    Returns:
        The row of the table, and the marks of the chart. The value error is relative to the largest value of a tensor.
    """
    scene = scene or SCENES[name]
    size = f"{scene.recipe.n_anchors} anchors, k={scene.recipe.gaussians_per_anchor}"
    runs = {path: DecodeRun(scene, backend) for path, backend in COMPARED.items()}
    timings = interleaved(runs, n_runs)
    exact = DecodeRun(scene, EXACT)
    exact()
    expected, truth = exact.decode(), exact.gradients()
    marks = {}
    for path, run in runs.items():
        run()
        gradients = run.gradients()
        marks[path] = SpeedError(
            operation="decode",
            scene=name,
            size=size,
            backend=path,
            total_ms=sum(stage.median_ms for stage in timings[path]),
            value_error=_value_error(run.decode(), expected),
            gradient_error=relative_errors([gradients[key] for key in truth], list(truth.values())),
        )
    forward, backward = timings["cpu"]
    peak_mb = peak_extra_mb(prepare_memory, scene) if has_memory else None
    return kernel_row(marks, (forward, backward), size=size, peak_mb=peak_mb), list(marks.values())


def prepare_memory(scene: DecodeScene) -> Callable[[], object]:
    """For `peak_extra_mb`: kernels loaded, model made; the call is one forward and backward pass."""
    from engine.kernels.threads import configure_threads

    configure_threads()
    DecodeRun(replace(scene, recipe=replace(scene.recipe, n_anchors=64)), FAST)()
    run = DecodeRun(scene, FAST)
    return partial(run.__call__)


def _value_error(actual: Gaussians, expected: Gaussians) -> float:
    pairs = zip(actual.tensors(), expected.tensors(), strict=True)
    return max(((a.double() - b).abs().max() / b.abs().max()).item() for a, b in pairs)
