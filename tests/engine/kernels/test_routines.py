"""Routines run once per worker on every threading layer, call each other by symbol, and read the arrays of a job."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import torch
from numba import njit, types

from engine.kernels import routines
from engine.kernels.arrays import Doubles1, Flags2, Floats2, Ints1, address_of, job_reader, pack
from engine.kernels.lanes import kernel_intrinsic
from engine.kernels.routines import WORKER, link, routine, run

ROOT = Path(__file__).resolve().parents[3]


class Job(NamedTuple):
    """One field of every sort, numbers between arrays."""

    values: Floats2
    factor: float
    flags: Flags2
    n_workers: int
    out: Doubles1
    visits: Ints1


@kernel_intrinsic
def _read(typing_context, address):
    """The Job at an address."""
    return job_reader(Job)


@routine(types.float64(types.float64))
def _half(value):
    return 0.5 * value


@njit
def _quarter(value):
    return 0.5 * _half(value)


@routine(WORKER)
def _sum_rows(worker, arguments):
    job = _read(arguments)
    job.visits[worker] += 1
    for row in range(worker, len(job.out), job.n_workers):
        total = 0.0
        for column in range(job.values.shape[1]):
            if job.flags[row, column]:
                total += job.values[row, column]
        job.out[row] = _quarter(total * job.factor)


@routine(WORKER)
def _never_run(worker, arguments):
    _half(1.0)


def make_job(n_workers: int) -> Job:
    values = torch.arange(35, dtype=torch.float32).reshape(7, 5)
    flags = np.arange(35).reshape(7, 5) % 3 == 0
    return Job(values, 4.0, flags, n_workers, np.zeros(7), np.zeros(n_workers, np.int64))


@pytest.mark.parametrize("n_workers", [1, 2, 5, 300])
def test_every_worker_runs_once_and_reads_its_job(n_workers):
    job = make_job(n_workers)
    run(_sum_rows, pack(job), n_workers)
    np.testing.assert_array_equal(job.out, np.where(job.flags, job.values, 0.0).sum(1))
    np.testing.assert_array_equal(job.visits, 1)


def test_only_what_is_called_is_compiled():
    name = f"{__name__}."
    link(_sum_rows)
    assert {f"{name}_sum_rows", f"{name}_half"} <= set(routines._compiled), "one is called through a jitted helper"
    assert f"{name}_never_run" not in routines._compiled


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("values", torch.zeros(7, 5, dtype=torch.float64)),
        ("values", torch.zeros(5, 7).T),
        ("values", torch.zeros(35)),
        ("out", np.zeros(14)[::2]),
        ("flags", np.zeros((7, 5), np.uint8)),
    ],
)
def test_an_unfit_array_is_refused(field, value):
    with pytest.raises(TypeError, match=field):
        pack(make_job(2)._replace(**{field: value}))


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
        "import numpy as np\n"
        "from numba import threading_layer\n"
        "from tests.engine.kernels import test_routines as t\n"
        "job = t.make_job(5)\n"
        "t.run(t._sum_rows, t.pack(job), 5)\n"
        "assert threading_layer() == 'workqueue'\n"
        "assert (job.visits == 1).all(), job.visits\n"
    )
    environment = {**os.environ, "NUMBA_THREADING_LAYER": "workqueue", "PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, "-c", probe], cwd=ROOT, env=environment, check=True, timeout=120)
