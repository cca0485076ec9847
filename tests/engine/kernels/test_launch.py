"""Kernels run once per worker on every threading layer, read their jobs, and hold every array until they are done."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import torch
from numba import njit, types

from engine.kernels import routines
from engine.kernels.jobs import (
    Counter,
    Doubles1,
    Flags2,
    Floats2,
    FloatsAt,
    Ints1,
    ManyFloats,
    Workers,
    address_of,
    floats_at,
    pack,
    read,
)
from engine.kernels.launch import kernel, launch
from engine.kernels.routines import ints, link, load_int, routine, take_next
from tests.guarded_memory import SEGMENTATION_FAULT, GuardedMemory, needs_page_rights, run_child

ROOT = Path(__file__).resolve().parents[3]


class SumJob(NamedTuple):
    """One field of every sort, numbers between arrays."""

    values: Floats2
    factor: float
    flags: Flags2
    weights: FloatsAt
    many: ManyFloats
    out: Doubles1
    visits: Ints1
    n_workers: Workers = None
    counter: Counter = None


@routine(types.float64(types.float64))
def _half(value):
    return 0.5 * value


@njit
def _quarter(value):
    return 0.5 * _half(value)


@kernel(SumJob)
def _sum_rows(worker, address):
    job = read(SumJob, address)
    job.visits[take_next(job.counter)] += 1
    for row in range(worker, len(job.out), job.n_workers):
        weights = floats_at(job.weights, job.values.shape[1])
        more = floats_at(load_int(job.many + 8 * (row % 2)), job.values.shape[1])
        total = 0.0
        for column in range(job.values.shape[1]):
            if job.flags[row, column]:
                total += job.values[row, column] * weights[column] + more[column]
        job.out[row] = _quarter(total * job.factor)


@routine(ints(2))
def _never_run(worker, arguments):
    _half(1.0)


def make_job(n_workers: int) -> SumJob:
    values = torch.arange(35, dtype=torch.float32).reshape(7, 5)
    flags = np.arange(35).reshape(7, 5) % 3 == 0
    many = [np.full(5, 2, np.float32), torch.full((5,), 3.0)]
    return SumJob(values, 4.0, flags, torch.ones(5), many, np.zeros(7), np.zeros(n_workers, np.int64))


def _expected(job: SumJob) -> np.ndarray:
    added = np.stack([np.asarray(job.many[row % 2]) for row in range(7)])
    return np.where(job.flags, np.asarray(job.values) + added, 0.0).sum(1)


@pytest.mark.parametrize("n_workers", [1, 2, 5, 300])
def test_every_worker_runs_once_and_reads_its_job(n_workers):
    job = make_job(n_workers)
    launch(_sum_rows, job, n_workers)
    np.testing.assert_array_equal(job.out, _expected(job))
    np.testing.assert_array_equal(job.visits, 1)


def test_every_launch_counts_from_zero():
    job = make_job(3)
    for _ in range(2):
        launch(_sum_rows, job, 3)
    np.testing.assert_array_equal(job.visits, 2)


def test_only_what_is_called_is_compiled():
    name = f"{__name__}."
    link(_sum_rows.routine)
    assert {f"{name}_sum_rows", f"{name}_half"} <= set(routines._compiled), "one is called through a jitted helper"
    assert f"{name}_never_run" not in routines._compiled


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("values", torch.zeros(7, 5, dtype=torch.float64)),
        ("values", torch.zeros(5, 7).T),
        ("values", torch.zeros(35)),
        ("values", torch.zeros(7, 5, device="meta")),
        ("values", None),
        ("out", np.zeros(14)[::2]),
        ("flags", np.zeros((7, 5), np.uint8)),
        ("weights", np.zeros(5)),
        ("many", [np.zeros(5, np.float32), np.zeros(10, np.float32)[::2]]),
        ("counter", np.zeros(1, np.int64)),
        ("n_workers", 3),
    ],
)
def test_an_unfit_field_is_refused(field, value):
    with pytest.raises(TypeError, match=field):
        launch(_sum_rows, make_job(2)._replace(**{field: value}))


def test_a_job_of_another_kernel_is_refused():
    with pytest.raises(TypeError, match="takes SumJob, got FillJob"):
        launch(_sum_rows, FillJob([np.zeros(1, np.float32)], 1, 0))


def test_no_array_is_address_zero():
    packed = pack(make_job(2)._replace(weights=None, many=[None, None]), 2)
    assert packed.table[7] == 0, "numbers and three lengths each of two matrices come before"
    assert packed.held[0].tolist() == [0, 0]


def test_addresses_of_empty_and_read_only_arrays():
    array = np.arange(3.0)
    expected = array.ctypes.data
    assert address_of(array) == expected
    array.setflags(write=False)
    assert address_of(array) == expected
    assert address_of(array[:0]) == 0


@pytest.mark.slow
def test_the_workqueue_layer_runs_every_worker():
    probe = (
        "from engine.kernels.launch import launch\n"
        "from engine.kernels.numba_internals import layer\n"
        "from tests.engine.kernels import test_launch as t\n"
        "job = t.make_job(5)\n"
        "t.launch(t._sum_rows, job, 5)\n"
        "assert layer() == 'workqueue'\n"
        "assert (job.visits == 1).all(), job.visits\n"
    )
    environment = {**os.environ, "NUMBA_THREADING_LAYER": "workqueue", "PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, "-c", probe], cwd=ROOT, env=environment, check=True, timeout=600)


class FillJob(NamedTuple):
    """Of a kernel that goes over its arrays again and again, for longer than anything collects garbage."""

    many: ManyFloats
    n_values: int
    n_rounds: int


@kernel(FillJob)
def _fill(worker, address):
    job = read(FillJob, address)
    for _ in range(job.n_rounds):
        for i in range(4):
            values = floats_at(load_int(job.many + 8 * i), job.n_values)
            for place in range(job.n_values):
                values[place] += np.float32(1)


_N_VALUES = 5000


def _launch_temporaries(_say: Callable[[str], None]) -> None:
    """Arrays that only the job holds, in memory that is given back at once, while another thread collects garbage."""
    guarded = GuardedMemory(is_behind=True)
    is_done = threading.Event()

    def collect() -> None:
        while not is_done.is_set():
            gc.collect()
            np.zeros(_N_VALUES, np.float32)

    thread = threading.Thread(target=collect)
    thread.start()
    for _ in range(20):
        kept = guarded.array(np.zeros(_N_VALUES, np.float32))
        temporaries = [torch.from_numpy(guarded.array(np.ones(_N_VALUES, np.float32))) for _ in range(2)]
        launch(_fill, FillJob([kept, *temporaries, guarded.array(np.ones(_N_VALUES, np.float32))], _N_VALUES, 300), 1)
        assert kept.min() == kept.max() == 300
    is_done.set()
    thread.join()


def _launch_what_nobody_holds(_say: Callable[[str], None]) -> None:
    """What `launch` would be without holding anything: the job packed, and its arrays gone before the kernel runs."""
    guarded = GuardedMemory(is_behind=True)
    packed = pack(FillJob([guarded.array(np.ones(_N_VALUES, np.float32)) for _ in range(4)], _N_VALUES, 1), 1)
    gc.collect()
    launch(_touch, PackedJob(address_of(packed.table)), 1)


class PackedJob(NamedTuple):
    """The address of a FillJob that was packed before."""

    table: int


@kernel(PackedJob)
def _touch(worker, address):
    filled = read(FillJob, read(PackedJob, address).table)
    values = floats_at(load_int(filled.many), 1)
    values[0] += np.float32(1)


@pytest.mark.slow
@needs_page_rights
def test_temporaries_live_until_the_kernel_is_done():
    code, _ = run_child(_launch_temporaries)
    assert code == 0, f"{SEGMENTATION_FAULT} is an access to memory that nobody held"


@pytest.mark.slow
@needs_page_rights
def test_memory_that_nobody_holds_would_be_noticed():
    code, _ = run_child(_launch_what_nobody_holds)
    assert code == SEGMENTATION_FAULT
