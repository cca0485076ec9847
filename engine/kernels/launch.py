"""The one way to run a kernel: `launch` takes a job of arrays, and holds them until every thread is done.

A kernel is a routine of two numbers, which worker it is and where its job lies; `read` makes the job of the address:

    class HalveJob(NamedTuple):
        values: Floats1
        out: Floats1
        n_workers: Workers = None

    @kernel(HalveJob)
    def halve(worker, address):
        job = read(HalveJob, address)
        for i in range(worker, len(job.values), job.n_workers):
            job.out[i] = job.values[i] / 2

    launch(halve, HalveJob(values, out))

The threads are those of numba's threading layer, called by the function that numba's own parallel loops call: no loop
is compiled.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import cache
from threading import RLock
from typing import Any, NamedTuple

from llvmlite import ir
from numba import get_num_threads, types

from engine.kernels.jobs import address_of, pack
from engine.kernels.lanes import INT64, kernel_intrinsic
from engine.kernels.numba_internals import layer, parallel_for
from engine.kernels.routines import ints, link, load_int, routine

_one_at_a_time = RLock()


@dataclass(frozen=True, slots=True)
class Kernel:
    """A routine that can be launched.

    Attributes:
        routine: Takes the number of the worker and the address of the packed job.
        job: Class of its job.
    """

    routine: Any
    job: type


def kernel(job: type, **options: Any) -> Callable[[Callable[[Any, Any], None]], Kernel]:
    """Decorator: make a module-level function of (worker, address) a kernel for jobs of a class.

    Args:
        job: A NamedTuple as in `engine.kernels.jobs`.
        options: Those of numba beyond `engine.kernels.routines.OPTIONS`, such as fastmath.
    """

    def register(function: Callable[[Any, Any], None]) -> Kernel:
        return Kernel(routine(ints(2), **options)(function), job)

    return register


def launch(started: Kernel, job: NamedTuple, n_workers: int | None = None) -> None:
    """Run a kernel once per worker, in parallel; returns when all are done. Its arrays are held as long.

    Args:
        started: The kernel.
        job: Of the kernel's class. Results are written into its arrays.
        n_workers: None for as many as there are threads.
    Raises:
        TypeError: The job is of another class, or an array of it does not fit; the message names it.
    """
    if type(job) is not started.job:
        raise TypeError(f"the kernel takes {started.job.__name__}, got {type(job).__name__}")
    with parallel_guard():
        n_threads = get_num_threads()
        n_workers = n_threads if n_workers is None else n_workers
        packed = pack(job, n_workers)  # alive, as the job is, until this function returns
        data = (ctypes.c_int64 * 2)(link(started.routine), address_of(packed.table))
        call, enter = _loop()
        arrays, lengths, steps, _ = _numbers(n_workers)
        call(enter, arrays, lengths, steps, data, 0, 1, n_threads)


def parallel_guard() -> AbstractContextManager[object]:
    """To be held around parallel kernels. Free where numba's threads may be shared, a lock where they may not."""
    get_num_threads()  # starts the threads, so that the layer is known
    return _one_at_a_time if layer() == "workqueue" else nullcontext()


@cache
def _numbers(n_workers: int) -> tuple[Any, Any, Any, Any]:
    """Numbers of the workers as a threading layer takes them: arrays (one), their length, bytes a step; and memory."""
    numbers = (ctypes.c_int64 * n_workers)(*range(n_workers))
    first = (ctypes.c_int64 * 1)(ctypes.addressof(numbers))
    return first, (ctypes.c_int64 * 1)(n_workers), (ctypes.c_int64 * 1)(8), numbers


@cache
def _loop() -> tuple[Any, int]:
    """The loop of the threading layer, and what it calls in every thread."""
    return parallel_for(), link(_enter)


@kernel_intrinsic
def _call(typing_context, address, worker, arguments):
    """Call the routine at an address."""

    def generate(context, builder, signature, arguments):
        function_type = ir.FunctionType(ir.VoidType(), [INT64, INT64])
        builder.call(builder.inttoptr(arguments[0], function_type.as_pointer()), arguments[1:])

    return types.void(types.int64, types.int64, types.int64), generate


@routine(ints(4))
def _enter(arrays, lengths, steps, data):
    """Called by a threading layer for a part of the workers: `data` holds the addresses of routine and job."""
    first = load_int(arrays)
    for part in range(load_int(lengths)):
        _call(load_int(data), load_int(first + part * load_int(steps)), load_int(data + 8))
