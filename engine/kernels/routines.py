"""Compiled routines that call each other by symbol, and the one loop that runs them on several threads.

numba links every jitted helper into each of its callers, and into theirs, and optimises the whole again each time; with
a parallel loop on top once more. For the many helpers of the decode that would be half a minute of compiling. A routine
is compiled once by itself and called through its symbol, so compiling takes time in proportion to the code. Routines
take and return plain numbers; memory is passed as int64 addresses.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from threading import Lock
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir
from numba import cfunc, get_num_threads, njit, prange, types

from engine.kernels.lanes import FLOAT, INT64, kernel_intrinsic
from engine.kernels.threads import parallel_guard

OPTIONS: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy"}
"""numba options of all kernels."""

_waiting: dict[str, tuple[Callable[..., Any], Any]] = {}
_compiled: dict[str, Any] = {}
_linking = Lock()


def routine(signature: Any) -> Callable[[Callable[..., Any]], Any]:
    """Decorator: make a module-level function a routine. The result can be called from kernels only.

    Nothing is compiled before `run` is first called. A routine must be defined after those that it calls.
    """

    def register(function: Callable[..., Any]) -> Any:
        name = f"{function.__module__}.{function.__qualname__}"
        _waiting[name] = (function, signature)
        return types.ExternalFunction(name, signature)

    return register


def ints(n: int) -> Any:
    """Signature of a routine of n int64 that returns nothing."""
    return types.void(*[types.int64] * n)


WORKER = ints(2)
"""Signature of a routine for `run`: number of the worker, address of its arguments."""


def run(worker_routine: Any, arguments: np.ndarray, n_workers: int | None = None) -> None:
    """Call a routine once per worker, in parallel; returns when all are done.

    Args:
        worker_routine: Routine with the signature WORKER.
        arguments: Passed by address. int64
        n_workers: None for as many as there are threads.
    """
    address = link(worker_routine)
    with parallel_guard():
        _run(address, arguments.ctypes.data, get_num_threads() if n_workers is None else n_workers)


@cache
def link(wanted: Any) -> int:
    """Address of a routine; compiles, or loads from the cache, every routine that was defined up to now."""
    with _linking:
        for name, (function, signature) in list(_waiting.items()):
            compiled = cfunc(signature, **{key: value for key, value in OPTIONS.items() if key != "nogil"})(function)
            llvm.add_symbol(name, compiled.address)
            _compiled[name] = compiled
            del _waiting[name]
    return _compiled[wanted.symbol].address


@kernel_intrinsic
def _call(typing_context, address, worker, arguments):
    """Call the routine at an address."""
    signature = types.void(types.int64, types.int64, types.int64)

    def generate(context, builder, signature, arguments):
        function_type = ir.FunctionType(ir.VoidType(), [INT64, INT64])
        builder.call(builder.inttoptr(arguments[0], function_type.as_pointer()), arguments[1:])
        return context.get_dummy_value()

    return signature, generate


@njit(parallel=True, **OPTIONS)
def _run(address, arguments, n_workers):
    for worker in prange(n_workers):
        _call(np.int64(address), np.int64(worker), np.int64(arguments))


def tuple_reader(fields: type) -> Any:
    """Signature and code of an intrinsic that reads a NamedTuple of int64 from its address."""
    n_fields = len(fields._fields)  # pyright: ignore[reportAttributeAccessIssue] - a NamedTuple class
    signature = types.NamedUniTuple(types.int64, n_fields, fields)(types.int64)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        places = [builder.add(arguments[0], ir.Constant(INT64, 8 * i)) for i in range(n_fields)]
        values = [builder.load(builder.inttoptr(place, INT64.as_pointer())) for place in places]
        return context.make_tuple(builder, signature.return_type, values)

    return signature, generate


@kernel_intrinsic
def load_int(typing_context, address):
    """The int64 at an address."""

    def generate(context, builder, signature, arguments):
        return builder.load(builder.inttoptr(arguments[0], INT64.as_pointer()))

    return types.int64(types.int64), generate


@kernel_intrinsic
def load_int32(typing_context, address):
    """The int32 at an address, as int64."""

    def generate(context, builder, signature, arguments):
        narrow = ir.IntType(32)
        return builder.sext(builder.load(builder.inttoptr(arguments[0], narrow.as_pointer())), INT64)

    return types.int64(types.int64), generate


@kernel_intrinsic
def load_float(typing_context, address):
    """The float32 at an address."""

    def generate(context, builder, signature, arguments):
        return builder.load(builder.inttoptr(arguments[0], FLOAT.as_pointer()))

    return types.float32(types.int64), generate


@kernel_intrinsic
def store_float(typing_context, address, value):
    """Write the float32 at an address."""

    def generate(context, builder, signature, arguments):
        builder.store(arguments[1], builder.inttoptr(arguments[0], FLOAT.as_pointer()))
        return context.get_dummy_value()

    return types.void(types.int64, types.float32), generate


@kernel_intrinsic
def take_next(typing_context, counter_address):
    """Atomically add one to the int64 at an address and return its old value: work for whichever thread is free."""
    signature = types.int64(types.int64)

    def generate(context, builder, signature, arguments):
        pointer = builder.inttoptr(arguments[0], INT64.as_pointer())
        return builder.atomic_rmw("add", pointer, ir.Constant(INT64, 1), "monotonic")

    return signature, generate
