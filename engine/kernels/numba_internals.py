"""Everything of numba and llvmlite that is not public and that the kernels stand on. Nothing else touches it.

Written for numba 0.68. `tests/engine/kernels/test_numba_internals.py` looks at each of these alone and says which one
an upgrade has broken; without them kernels would be linked into each other by numba, see `engine.kernels.routines`.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from types import FunctionType, ModuleType
from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir
from numba import types
from numba.core import cgutils, config
from numba.core.dispatcher import Dispatcher
from numba.np.arrayobj import make_array, populate_array
from numba.np.ufunc.parallel import threading_layer

WRITTEN_FOR = "0.68"
"""The minor version of numba with which all of this was tried."""


def no_value(context: Any) -> Any:
    """The value that an intrinsic without a result has to return."""
    return context.get_dummy_value()


def external(symbol: str, signature: Any) -> Any:
    """The function that kernels call to reach the code that `publish` has put under a symbol."""
    return types.ExternalFunction(symbol, signature)


def publish(symbol: str, compiled: Any) -> None:
    """Let code that is linked from now on find what numba's `cfunc` has compiled under a symbol."""
    llvm.add_symbol(symbol, compiled.address)


def called_externals(function: FunctionType) -> Iterator[str]:
    """Symbols of the `external` values that a function names, by themselves or in a module, and its jitted helpers."""
    names = function.__code__.co_names
    values = [function.__globals__[name] for name in names if name in function.__globals__]
    for module in [value for value in values if isinstance(value, ModuleType)]:
        values += [vars(module)[name] for name in names if name in vars(module)]
    for value in values:
        if isinstance(value, types.ExternalFunction):
            yield value.symbol
        elif isinstance(value, Dispatcher) and value.py_func is not function:
            yield from called_externals(value.py_func)


def parallel_for() -> Any:
    """The loop of numba's threading layer, whose call releases the interpreter lock.

    It takes: address of the function called in every thread, arrays, lengths, steps, data, inner dimensions, number of
    arrays, threads. The threads must have been started, which makes its symbol known.
    """
    kinds = [ctypes.c_void_p] * 5 + [ctypes.c_ssize_t] * 3
    return ctypes.CFUNCTYPE(None, *kinds)(llvm.address_of_symbol("numba_parallel_for"))


def layer() -> str | None:
    """Which library runs numba's threads; None before they have been started."""
    try:
        return threading_layer()
    except ValueError:
        return None


def choose_layer(name: str) -> None:
    """Choose the library that runs numba's threads, before they are started."""
    _config().THREADING_LAYER = name


def most_threads() -> int:
    """How many threads numba may use at most."""
    return int(_config().NUMBA_NUM_THREADS)


def _config() -> Any:  # its attributes are made at run time
    return config


def array_value(context: Any, builder: Any, kind: types.Array, address: Any, shape: list[Any]) -> Any:
    """A contiguous array at an address as a value inside a kernel, where nobody counts its references."""
    int64 = ir.IntType(64)
    item_bytes = context.get_abi_sizeof(context.get_data_type(kind.dtype))
    strides = [ir.Constant(int64, item_bytes)]
    for length in shape[:0:-1]:
        strides.insert(0, builder.mul(strides[0], length))
    array = make_array(kind)(context, builder)
    populate_array(
        array,
        data=builder.inttoptr(address, context.get_data_type(kind.dtype).as_pointer()),
        shape=cgutils.pack_array(builder, shape),
        strides=cgutils.pack_array(builder, strides),
        itemsize=ir.Constant(int64, item_bytes),
        meminfo=None,
    )
    return array._getvalue()
