"""Compiled routines that call each other by symbol, and the one call that runs one of them on several threads.

numba links every jitted helper into each of its callers, and into theirs, and optimises the whole again each time; with
a parallel loop on top once more, whose lowering takes seconds. A routine is compiled once by itself and called through
its symbol, so compiling takes time in proportion to the code. Routines take and return plain numbers; memory is passed
as int64 addresses, arrays of a job as `engine.kernels.arrays` packs them.

`run` calls numba's threading layer itself, with the function that numba's own parallel loops call: no loop is compiled.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from functools import cache
from threading import Lock
from types import FunctionType, ModuleType
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir
from numba import cfunc, get_num_threads, types
from numba.core.dispatcher import Dispatcher

from engine.kernels.arrays import address_of
from engine.kernels.lanes import FLOAT, INT64, kernel_intrinsic
from engine.kernels.threads import parallel_guard

OPTIONS: dict[str, Any] = {"cache": True, "error_model": "numpy"}
"""numba options of all routines."""

_defined: dict[str, tuple[FunctionType, Any, dict[str, Any]]] = {}
_compiled: dict[str, Any] = {}
_linking = Lock()


def routine(signature: Any, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Decorator: make a module-level function a routine. The result can be called from kernels only.

    Nothing is compiled before `run` or `link` needs it.

    Args:
        signature: Of numbers only.
        options: numba options beyond OPTIONS, such as fastmath.
    """

    def register(function: Callable[..., Any]) -> Any:
        assert isinstance(function, FunctionType)
        name = f"{function.__module__}.{function.__qualname__}"
        _defined[name] = (function, signature, OPTIONS | options)
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
    job = (ctypes.c_int64 * 2)(link(worker_routine), address_of(arguments))
    with parallel_guard():
        n_threads = get_num_threads()
        call, enter = _parallel_for()
        arrays, lengths, steps, _ = _numbers(n_threads if n_workers is None else n_workers)
        call(enter, arrays, lengths, steps, job, 0, 1, n_threads)


@cache
def _numbers(n_workers: int) -> tuple[Any, Any, Any, Any]:
    """Numbers of the workers as a threading layer takes them: arrays (one), their length, bytes a step; and memory."""
    numbers = (ctypes.c_int64 * n_workers)(*range(n_workers))
    first = (ctypes.c_int64 * 1)(ctypes.addressof(numbers))
    return first, (ctypes.c_int64 * 1)(n_workers), (ctypes.c_int64 * 1)(8), numbers


@cache
def _parallel_for() -> tuple[Any, int]:
    """numba's parallel loop, whose call releases the interpreter lock, and what it is to call in every thread.

    It takes: function, arrays, lengths, steps, data, inner dimensions, number of arrays, threads. The threads have been
    started, which makes its symbol known.
    """
    kinds = [ctypes.c_void_p] * 5 + [ctypes.c_ssize_t] * 3
    return ctypes.CFUNCTYPE(None, *kinds)(llvm.address_of_symbol("numba_parallel_for")), link(_enter)


def link(wanted: Any) -> int:
    """Address of a routine; compiles, or loads from the cache, it and every routine that it calls."""
    compiled = _compiled.get(wanted.symbol)
    if compiled is None:
        with _linking:
            _compile(wanted.symbol)
        compiled = _compiled[wanted.symbol]
    return compiled.address


def _compile(name: str) -> None:
    if name in _compiled:
        return
    function, signature, options = _defined[name]
    for called in _called(function):
        if called != name:
            _compile(called)
    compiled = cfunc(signature, **options)(function)
    llvm.add_symbol(name, compiled.address)
    _compiled[name] = compiled


def _called(function: FunctionType) -> Iterator[str]:
    """Names of the routines that a function names, by themselves or in a module, and those of its jitted helpers."""
    names = function.__code__.co_names
    values = [function.__globals__[name] for name in names if name in function.__globals__]
    for module in [value for value in values if isinstance(value, ModuleType)]:
        values += [vars(module)[name] for name in names if name in vars(module)]
    for value in values:
        if isinstance(value, types.ExternalFunction) and value.symbol in _defined:
            yield value.symbol
        elif isinstance(value, Dispatcher) and value.py_func is not function:
            yield from _called(value.py_func)


@kernel_intrinsic
def _call(typing_context, address, worker, arguments):
    """Call the routine at an address."""
    signature = types.void(types.int64, types.int64, types.int64)

    def generate(context, builder, signature, arguments):
        function_type = ir.FunctionType(ir.VoidType(), [INT64, INT64])
        builder.call(builder.inttoptr(arguments[0], function_type.as_pointer()), arguments[1:])
        return context.get_dummy_value()

    return signature, generate


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


@routine(ints(4))
def _enter(arrays, lengths, steps, data):
    """What a threading layer calls for a part of the workers: `data` holds the addresses of routine and arguments."""
    first = load_int(arrays)
    for part in range(load_int(lengths)):
        _call(load_int(data), load_int(first + part * load_int(steps)), load_int(data + 8))
