"""A phase reads nothing from its device between two reports, whoever computes its operations.

What would be a wait or a copy on a device is counted on the CPU, step by step: the phase itself makes none. What the
operations of a back end do among themselves is theirs; of plain torch it is counted too, as each is a wait elsewhere.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import pytest
import torch
from torch.overrides import TorchFunctionMode
from torch.utils._python_dispatch import TorchDispatchMode

from engine.backends.backend import Backend
from engine.backends.table import backend_called
from tests.engine.training.tiny_training import Tiny, finish, stepwise

pytestmark = pytest.mark.slow
SIZES: dict[str, Any] = {"static_steps": 2, "joint_steps": 4, "source_steps": 60, "max_static_points": 60,
                         "max_moving_points": 40, "gaussians_per_anchor": 2}  # fmt: skip
READS = ("item", "tolist", "numpy", "cpu")
OPERATIONS = ("_local_scalar_dense", "nonzero", "_to_copy")
WITHIN = {"cpu": {"numpy", "_local_scalar_dense"}, "reference": {"nonzero", "_to_copy"}}
"""What operations do among themselves: kernels read arrays where they lie, plain torch chooses rows."""


class Waits:
    """Counts what reads from the device or copies to it, apart from what is inside of an operation."""

    def __init__(self) -> None:
        self.of_phase: Counter[str] = Counter()
        self.of_operations: Counter[str] = Counter()
        self._depth = 0

    def note(self, name: str) -> None:
        (self.of_operations if self._depth else self.of_phase)[name] += 1

    @contextmanager
    def inside(self) -> Iterator[None]:
        self._depth += 1
        try:
            yield
        finally:
            self._depth -= 1

    @contextmanager
    def counted(self) -> Iterator[None]:
        self.of_phase.clear()
        self.of_operations.clear()
        with _Reads(self), _Operations(self):
            yield


def _is_of_host(tensor: torch.Tensor) -> bool:
    """Matrices of a camera are in main memory everywhere; numbers of rows are checked only where they are there."""
    return tensor.shape[-2:] in ((4, 4), (3, 3)) or tensor.dtype == torch.int64


class _Reads(TorchFunctionMode):
    def __init__(self, waits: Waits) -> None:
        super().__init__()
        self._waits = waits

    def __torch_function__(self, func, types, args=(), kwargs=None):
        if getattr(func, "__name__", "") in READS and not _is_of_host(args[0]):
            self._waits.note(func.__name__)
        return func(*args, **(kwargs or {}))


class _Operations(TorchDispatchMode):
    def __init__(self, waits: Waits) -> None:
        super().__init__()
        self._waits = waits

    def __torch_dispatch__(self, func, types, args=(), kwargs=None):
        if func.overloadpacket.__name__ in OPERATIONS and not _is_of_host(args[0]):
            self._waits.note(func.overloadpacket.__name__)
        return func(*args, **(kwargs or {}))


class Watched:
    """Hands everything on, and says when it is inside: a back end, its Adam and its boxes of tiles."""

    def __init__(self, inner: Any, waits: Waits) -> None:
        self.__dict__.update(_inner=inner, _waits=waits)

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._inner, name)
        if not callable(value):
            return value

        def call(*arguments: Any, **options: Any) -> Any:
            with self._waits.inside():
                result = value(*arguments, **options)
            return Watched(result, self._waits) if name in ("adam", "tile_boxes") else result

        return call

    def __getitem__(self, rows: Any) -> Any:
        with self._waits.inside():
            return Watched(self._inner[rows], self._waits)


@pytest.fixture
def waits(monkeypatch) -> Waits:
    waits, backward = Waits(), torch.Tensor.backward

    def watched(tensor: torch.Tensor, *arguments: Any, **options: Any) -> None:
        with waits.inside():
            backward(tensor, *arguments, **options)

    monkeypatch.setattr(torch.Tensor, "backward", watched)
    return waits


@pytest.fixture(scope="module")
def small(tiny: Tiny, small_backdrop: None, tmp_path_factory) -> Tiny:
    """With a reference clip of few anchors, in a folder of its own: what both back ends prepare is the same."""
    own = replace(tiny, prep_dir=tmp_path_factory.mktemp("prep"))
    training = own.prepared(0, is_source=False, **SIZES)
    reference = finish(training)
    training.finish()
    return replace(own, reference=reference)


@pytest.mark.parametrize("name", ["cpu", "reference"])
@pytest.mark.parametrize("stage", ["source", "joint", "static"])
def test_a_phase_waits_once_a_report(small: Tiny, waits, name, stage):
    backend: Backend = Watched(backend_called(name), waits)  # type: ignore[assignment]
    is_source = stage == "source"
    training = small.prepared(int(is_source), is_source=is_source, backend=backend, **SIZES)
    if stage == "joint":
        training.step(2)
    phase, items = stepwise(training), training._items[:2]
    phase.run(items)  # what a camera sees is found once
    for n in (1, 2):
        with waits.counted():
            phase.run(items[:n])
        assert waits.of_phase.keys() == {"tolist", "_to_copy"}
        assert waits.of_phase["tolist"] == 1
        assert waits.of_phase["_to_copy"] <= 3  # kinds of numbers to float64, before they are read
        assert waits.of_operations.keys() <= WITHIN[name]
