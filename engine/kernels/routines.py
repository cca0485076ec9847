"""Compiled routines that call each other by symbol.

numba links every jitted helper into each of its callers, and into theirs, and optimises the whole again each time; with
a parallel loop on top once more, whose lowering takes seconds. A routine is compiled once by itself and called through
its symbol, so compiling takes time in proportion to the code. Routines take and return plain numbers; memory is passed
as int64 addresses, arrays as jobs of `engine.kernels.jobs`. `engine.kernels.launch` runs them on several threads.
"""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock
from types import FunctionType
from typing import Any

from llvmlite import ir
from numba import cfunc, types

from engine.kernels.lanes import FLOAT, INT64, kernel_intrinsic
from engine.kernels.numba_internals import called_externals, external, publish

OPTIONS: dict[str, Any] = {"cache": True, "error_model": "numpy"}
"""numba options of all routines."""

_defined: dict[str, tuple[FunctionType, Any, dict[str, Any]]] = {}
_compiled: dict[str, Any] = {}
_linking = Lock()


def routine(signature: Any, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Decorator: make a module-level function a routine. The result can be called from kernels only.

    Nothing is compiled before `launch` or `link` needs it.

    Args:
        signature: Of numbers only.
        options: numba options beyond OPTIONS, such as fastmath.
    """

    def register(function: Callable[..., Any]) -> Any:
        assert isinstance(function, FunctionType)
        name = f"{function.__module__}.{function.__qualname__}"
        _defined[name] = (function, signature, OPTIONS | options)
        return external(name, signature)

    return register


def ints(n: int) -> Any:
    """Signature of a routine of n int64 that returns nothing."""
    return types.void(*[types.int64] * n)


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
    for called in called_externals(function):
        if called != name and called in _defined:
            _compile(called)
    compiled = cfunc(signature, **options)(function)
    publish(name, compiled)
    _compiled[name] = compiled


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

    return types.void(types.int64, types.float32), generate


@kernel_intrinsic
def take_next(typing_context, counter_address):
    """Atomically add one to the int64 at an address and return its old value: work for whichever thread is free."""
    signature = types.int64(types.int64)

    def generate(context, builder, signature, arguments):
        pointer = builder.inttoptr(arguments[0], INT64.as_pointer())
        return builder.atomic_rmw("add", pointer, ir.Constant(INT64, 1), "monotonic")

    return signature, generate
