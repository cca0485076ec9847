"""The fused back end of the decode: kernels in order, and their place in autograd.

Forward: blocks of 64 anchors go from the grid to Gaussians at once (forward); sets that never change are copied.
Backward: blocks again (backward), then tables (grid_kernels) and weights, whose sums come in a fixed number of groups.
Hidden layers are never stored; only grid values are, because gathering them again costs more than reading them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
import torch
from numba import get_num_threads
from torch import Tensor

from engine.backends.cpu.decode import layout as lay
from engine.backends.cpu.decode.backward import WeightSums, differentiate_blocks, write_weight_gradients
from engine.backends.cpu.decode.forward import decode_blocks
from engine.backends.cpu.decode.grid_kernels import SpreadJob, spread_gradient
from engine.backends.cpu.decode.layout import BLOCK, DecodeJob, Sizes
from engine.backends.cpu.decode.rows import Copy, copy_rows
from engine.kernels.launch import launch
from engine.kernels.memory import RecycledMemory
from engine.kernels.workspace import Workspace, WorkspacePool
from engine.model.decoder import HEADS, Decoder
from engine.model.field import SpatioTemporalField
from engine.raster.gaussians import Gaussians

if TYPE_CHECKING:
    from engine.model.decoding import ChosenAnchors

POOL = WorkspacePool()
"""Idle scratch memory of this process."""
MEMORY = RecycledMemory()
"""Idle memory of results and gradients."""

_ORDINALS = np.arange(BLOCK)
_PER_SET = 3
"""Tensors of a set that may learn: features and the two log scales."""
_COLUMNS = ("means", "quats", "scales", "opacities", "colors")
_D_COLUMNS = tuple(f"d_{name}" for name in _COLUMNS)
_T = TypeVar("_T")


class _Wanted(NamedTuple):
    """Which gradients of a set somebody needs: its features, its log scales, the heads, the field with its tables."""

    features: bool
    scales: bool
    heads: bool
    field: bool


@dataclass(slots=True)
class _Plan:
    """The inputs of a decode, apart from the tensors that may learn.

    Those come as one list: three of each set, then the weights in the order of `layout`, then the tables of the knots.

    Attributes:
        chosen: Sets with at least one row.
        first_anchors: Anchors before each set in the output.
        n_anchors: Of all sets.
        sizes: Widths.
        knot_weights: One or two.
        knot_keys: Of these knots, see engine.model.grid.time_keys. [2, L] int32
        is_rectified: 1 where the field's network ends in a ReLU.
    """

    chosen: list[ChosenAnchors]
    first_anchors: list[int]
    n_anchors: int
    sizes: Sizes
    knot_weights: list[float]
    knot_keys: np.ndarray
    is_rectified: int

    @property
    def n_own(self) -> int:
        """How many tensors belong to single sets."""
        return _PER_SET * len(self.chosen)

    def own(self, index: int, values: list[_T]) -> list[_T]:
        """Of one value per tensor, those of one set: features, log offset scales, log base scales."""
        return values[_PER_SET * index : _PER_SET * (index + 1)]

    def shared(self, values: list[_T]) -> list[_T]:
        """Of one value per tensor, those of weights and tables."""
        return values[self.n_own :]

    def wanted(self, index: int, needs: list[bool]) -> _Wanted:
        """Which gradients of a set somebody needs, given whether each tensor needs one."""
        part = self.chosen[index]
        if part.decoded is not None:
            return _Wanted(features=False, scales=False, heads=False, field=False)
        features, *scales = self.own(index, needs)
        shared = self.shared(needs)
        return _Wanted(
            features=features,
            scales=any(scales),
            heads=any(shared[: lay.FIELD_HIDDEN]),
            field=part.corners is not None and any(shared[lay.FIELD_HIDDEN :]),
        )


def decode_cpu(
    chosen: Sequence[ChosenAnchors],
    decoder: Decoder,
    field: SpatioTemporalField | None,
    knots: Sequence[tuple[int, float]],
) -> Gaussians:
    """Arguments are those of `decode_anchors`, already checked; without gradient for positions and colour logits.

    Raises:
        TypeError: A tensor is not contiguous float32 on the cpu.
    """
    _require_float32(chosen, decoder, field)
    plan = _plan(chosen, decoder, field, knots)
    tensors: list[Tensor] = []
    for part in plan.chosen:
        anchors = part.anchors
        tensors += [anchors.features, anchors.log_offset_scales, anchors.log_base_scales]
    for kind in (decoder.first, decoder.first_bias, decoder.second, decoder.second_bias):
        tensors += [kind[head] for head in HEADS]
    if field is not None:
        tensors += [field.hidden.weight, field.out.weight, *(field.table(knot) for knot, _ in knots)]
    needs = [tensor.requires_grad for tensor in tensors]
    if torch.is_grad_enabled() and any(any(plan.wanted(index, needs)) for index in range(len(plan.chosen))):
        columns = _Decode.apply(plan, *tensors)
    else:  # also where something learns, but nothing that these rows depend on
        columns, _ = _decode(plan, [tensor.detach() for tensor in tensors], keeps_encoded=False)
    return Gaussians(*columns, is_frozen=_frozen_rows(plan))  # pyright: ignore


def _require_float32(chosen: Sequence[ChosenAnchors], decoder: Decoder, field: SpatioTemporalField | None) -> None:
    """TypeError that names a tensor which kernels, who take it by address, would misread."""
    tensors: list[tuple[str, Tensor]] = [("decoder", decoder.first["opacity"])]
    if field is not None:
        tensors.append(("field", field.hidden.weight))
    for part in chosen:
        anchors = part.anchors
        tensors += [
            ("features", anchors.features),
            ("positions", part.places),
            ("color_logits", anchors.color_logits),
            ("log_offset_scales", anchors.log_offset_scales),
            ("log_base_scales", anchors.log_base_scales),
        ]
        if part.decoded is not None:
            tensors += [("decoded", tensor) for tensor in part.decoded.tensors()]
        if not part.rows.is_contiguous():
            raise TypeError("back end 'cpu' needs contiguous rows")
    for name, tensor in tensors:
        if tensor.dtype != torch.float32 or tensor.device.type != "cpu" or not tensor.is_contiguous():
            raise TypeError(
                f"back end 'cpu' needs contiguous float32 tensors on the cpu; {name} is {tensor.dtype} on "
                f"{tensor.device}, {'contiguous' if tensor.is_contiguous() else 'not contiguous'}"
            )


def _plan(
    chosen: Sequence[ChosenAnchors],
    decoder: Decoder,
    field: SpatioTemporalField | None,
    knots: Sequence[tuple[int, float]],
) -> _Plan:
    filled = [part for part in chosen if len(part.rows)]
    starts = [0]
    for part in filled:
        starts.append(starts[-1] + len(part.rows))
    sizes = Sizes(
        n_gaussians=decoder.gaussians_per_anchor,
        n_static=decoder.static_dim,
        n_dynamic=decoder.dynamic_dim,
        n_hidden=decoder.hidden,
        n_encoded=0 if field is None else len(field.shape.cells) * field.shape.channels,
        n_field_hidden=0 if field is None else field.shape.hidden,
    )
    keys = np.zeros((2, 0 if field is None else len(field.shape.cells)), np.int32)
    if field is not None:
        keys[: len(knots)] = field.keys.numpy()[[knot for knot, _ in knots]]
    is_rectified = int(field is not None and field.shape.is_rectified)
    return _Plan(filled, starts[:-1], starts[-1], sizes, [weight for _, weight in knots], keys, is_rectified)


def _frozen_rows(plan: _Plan) -> Tensor | None:
    if all(part.decoded is None for part in plan.chosen):
        return None
    k = plan.sizes.n_gaussians
    is_frozen = torch.zeros(plan.n_anchors * k, dtype=torch.bool)
    for part, first in zip(plan.chosen, plan.first_anchors, strict=True):
        if part.decoded is not None:
            is_frozen[first * k : (first + len(part.rows)) * k] = True
    return is_frozen


class _Decode(torch.autograd.Function):
    """All sets at once. Gradients for everything that may learn."""

    @staticmethod
    def forward(ctx: Any, plan: _Plan, *tensors: Tensor):
        columns, encoded = _decode(plan, [tensor.detach() for tensor in tensors], keeps_encoded=True)
        ctx.plan = plan
        ctx.save_for_backward(*tensors, *columns, *encoded)
        return columns

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, *gradients: Tensor):  # pyright: ignore[reportIncompatibleMethodOverride]
        saved = [tensor.detach() for tensor in ctx.saved_tensors]
        needs = list(ctx.needs_input_grad[1:])
        n_tensors, n_columns = len(needs), len(gradients)
        tensors, columns, encoded = saved[:n_tensors], saved[n_tensors:][:n_columns], saved[n_tensors + n_columns :]
        return None, *_differentiate(ctx.plan, tensors, needs, columns, gradients, encoded)


def _decode(plan: _Plan, tensors: list[Tensor], *, keeps_encoded: bool) -> tuple[tuple[Tensor, ...], list[Tensor]]:
    """The columns of Gaussians, and the grid values of each set if they are to be kept."""
    sizes = plan.sizes
    n_rows = plan.n_anchors * sizes.n_gaussians
    columns = tuple(MEMORY.empty(*((n_rows, width) if width else (n_rows,))) for width in (3, 4, 3, 0, 3))
    kept: list[Tensor] = []
    with _Kernels(plan, tensors, columns, is_backward=False) as kernels:
        for index, part in enumerate(plan.chosen):
            if part.decoded is not None:
                kernels.copy(index, part.decoded)
                kept.append(torch.empty(0))
                continue
            n_blocks = -(-len(part.rows) // BLOCK) if keeps_encoded else kernels.n_workers
            encoded = MEMORY.empty(n_blocks * BLOCK if part.corners is not None else 0, lay.padded(sizes.n_encoded))
            job = kernels.job(index, encoded)
            launch(decode_blocks, job._replace(keeps_encoded=int(keeps_encoded)), kernels.n_workers)
            kept.append(encoded)
    return columns, kept if keeps_encoded else []


def _differentiate(
    plan: _Plan,
    tensors: list[Tensor],
    needs: list[bool],
    columns: list[Tensor],
    d_columns: tuple[Tensor, ...],
    kept: list[Tensor],
) -> list[Tensor | None]:
    """Gradients of `tensors`, None where not needed."""
    gradients: list[Tensor | None] = [None] * len(tensors)
    d_columns = tuple(gradient.contiguous() for gradient in d_columns)
    first_shared, first_table = plan.n_own, plan.n_own + lay.N_WEIGHTS
    with _Kernels(plan, tensors, columns, is_backward=True) as kernels:
        places = lay.gradient_places(plan.sizes)
        sums = kernels.workspace.array("sums", (lay.MAX_GROUPS, places.n_floats), np.float32)
        sums.fill(0)
        starts = np.array(places.starts)
        is_first = True
        for index in range(len(plan.chosen)):
            wanted = plan.wanted(index, needs)
            if not any(wanted):
                continue
            d_own = [
                MEMORY.zeros_like(tensor) if is_wanted else torch.empty(0)
                for tensor, is_wanted in zip(
                    plan.own(index, tensors), (wanted.features, wanted.scales, wanted.scales), strict=True
                )
            ]
            d_encoded = MEMORY.empty_like(kept[index]) if wanted.field else torch.empty(0)
            job = kernels.job(index, kept[index])._replace(
                **dict(zip(_D_COLUMNS, d_columns, strict=True)),
                **{f"wants_{name}": int(value) for name, value in wanted._asdict().items()},
                d_features=d_own[0],
                d_log_offset_scales=d_own[1],
                d_log_base_scales=d_own[2],
                d_encoded=d_encoded,
                places=starts,
                sums=sums,
                sums_bytes=sums.strides[0],
            )
            launch(differentiate_blocks, job, kernels.n_workers)
            for place, gradient in enumerate(d_own, start=_PER_SET * index):
                gradients[place] = gradient if needs[place] else None
            if wanted.field:
                for knot in range(len(plan.knot_weights)):
                    place = first_table + knot
                    if needs[place]:
                        if is_first:
                            gradients[place] = MEMORY.empty_like(tensors[place])
                        kernels.spread(job, knot, gradients[place], is_first=is_first)
                is_first = False
        for place in range(first_shared, len(tensors)):
            if needs[place] and gradients[place] is None:  # weights are written below, unused tables have no gradient
                make = MEMORY.empty_like if place < first_table else MEMORY.zeros_like
                gradients[place] = make(tensors[place])
        kernels.write_weights(sums, starts, gradients[first_shared:first_table])
    return gradients


class _Kernels:
    """Makes jobs for one decode or its backward pass, and owns a workspace while it is entered."""

    def __init__(self, plan: _Plan, tensors: list[Tensor], columns: Sequence[Tensor], *, is_backward: bool) -> None:
        self.plan, self.tensors = plan, tensors
        self.n_workers = get_num_threads()
        shared = plan.shared(tensors)
        weights: list[Tensor | None] = [*shared[: lay.N_WEIGHTS]]
        tables = shared[lay.N_WEIGHTS :]
        self._knot_weights = np.array([*plan.knot_weights, 0.0][:2], np.float32)
        self._regions = lay.regions(plan.sizes, is_backward=is_backward)
        table = tables[0] if tables else None
        self._fixed = {
            **plan.sizes._asdict(),
            **{f"at_{name}": lay.ROW_BYTES * row for name, row in self._regions._asdict().items() if name != "n_rows"},
            **dict(zip(_COLUMNS, columns, strict=True)),
            "weights": weights + [None] * (lay.N_WEIGHTS - len(weights)),
            "table": table,
            "next_table": tables[1] if len(tables) > 1 else None,
            "knot_weights": self._knot_weights,
            "knot_keys": plan.knot_keys,
            "is_rectified": plan.is_rectified,
            "n_levels": 0 if table is None else table.shape[0],
            "n_entries": 0 if table is None else table.shape[1],
            "n_channels": 0 if table is None else table.shape[2],
            "ordinals": _ORDINALS,
            "keeps_encoded": 1,
        }

    def __enter__(self) -> _Kernels:
        self.workspace: Workspace = POOL.take()
        shape = (self.n_workers, self._regions.n_rows * BLOCK)
        scratch = self.workspace.array("scratch", shape, np.float32)
        self._fixed |= {"scratch": scratch, "scratch_bytes": scratch.strides[0]}
        return self

    def __exit__(self, *_: object) -> None:
        POOL.give_back(self.workspace)

    def job(self, index: int, encoded: Tensor) -> DecodeJob:
        """Arguments for one set; no gradients yet."""
        part = self.plan.chosen[index]
        anchors, corners = part.anchors, part.corners
        features, log_offset_scales, log_base_scales = self.plan.own(index, self.tensors)
        return DecodeJob(
            **self._fixed,
            features=features,
            positions=part.places.detach(),
            color_logits=anchors.color_logits,
            log_offset_scales=log_offset_scales,
            log_base_scales=log_base_scales,
            rows=part.rows,
            n_rows=len(part.rows),
            corner_indices=None if corners is None else corners.indices,
            corner_weights=None if corners is None else corners.weights,
            encoded=encoded,
            first_anchor=self.plan.first_anchors[index],
        )

    def copy(self, index: int, decoded: Gaussians) -> None:
        """Copy the Gaussians of a set that were decoded before."""
        part, k = self.plan.chosen[index], self.plan.sizes.n_gaussians
        for name, source in zip(_COLUMNS, decoded.tensors(), strict=True):
            row_bytes = 4 * k * (source.shape[1] if source.ndim == 2 else 1)
            first = self.plan.first_anchors[index]
            job = Copy(source, self._fixed[name], row_bytes, part.rows, len(part.rows), first)
            launch(copy_rows, job, self.n_workers)

    def spread(self, job: DecodeJob, knot: int, d_table: Tensor | None, *, is_first: bool) -> None:
        """Gradient of one knot's table from the job's `d_encoded`."""
        assert d_table is not None
        arguments = SpreadJob(
            rows=job.rows,
            n_rows=job.n_rows,
            corner_indices=job.corner_indices,
            corner_weights=job.corner_weights,
            keys=self.plan.knot_keys[knot],
            d_encoded=job.d_encoded,
            row_bytes=4 * lay.padded(job.n_encoded),
            scale=self._knot_weights[knot:],
            d_table=d_table,
            is_first=int(is_first),
            n_levels=job.n_levels,
            n_entries=job.n_entries,
            n_channels=job.n_channels,
        )
        launch(spread_gradient, arguments, self.n_workers)

    def write_weights(self, sums: np.ndarray, starts: np.ndarray, gradients: list[Tensor | None]) -> None:
        """Sums of groups to gradients of weights; None where none is wanted."""
        if all(gradient is None for gradient in gradients):
            return
        n_outputs, n_inputs = (np.array(widths) for widths in lay.weight_widths(self.plan.sizes))
        arguments = WeightSums(
            sums=sums,
            sums_bytes=sums.strides[0],
            places=starts,
            gradients=gradients + [None] * (lay.N_WEIGHTS - len(gradients)),  # a model without a field has fewer
            n_outputs=n_outputs,
            n_inputs=n_inputs,
        )
        launch(write_weight_gradients, arguments, self.n_workers)
