"""Arrays as arguments of routines: packed as addresses and lengths on one side, arrays again on the other.

A job is a NamedTuple whose annotations say what a field is: `int`, `float`, or an array such as `Floats2` (float32 with
two dimensions). `pack` writes one in main memory, a reader made by `job_reader` gives it to a kernel.
"""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np
import torch
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.np.arrayobj import make_array, populate_array
from numba.np.numpy_support import from_dtype
from torch import Tensor

from engine.kernels.lanes import INT64


class _Kind(NamedTuple):
    """dtype, the same for torch (None where torch has none), and number of dimensions; -1 for a number."""

    dtype: np.dtype
    torch_dtype: torch.dtype | None
    n_dimensions: int


def _kind(dtype: type[np.generic], n_dimensions: int) -> _Kind:
    return _Kind(np.dtype(dtype), getattr(torch, np.dtype(dtype).name, None), n_dimensions)


Array = np.ndarray | Tensor
Floats1 = Annotated[Array, _kind(np.float32, 1)]
Floats2 = Annotated[Array, _kind(np.float32, 2)]
Floats3 = Annotated[Array, _kind(np.float32, 3)]
Doubles1 = Annotated[Array, _kind(np.float64, 1)]
Doubles2 = Annotated[Array, _kind(np.float64, 2)]
Doubles3 = Annotated[Array, _kind(np.float64, 3)]
Ints1 = Annotated[Array, _kind(np.int64, 1)]
Ints2 = Annotated[Array, _kind(np.int64, 2)]
Ints3 = Annotated[Array, _kind(np.int64, 3)]
SmallInts1 = Annotated[Array, _kind(np.int32, 1)]
SmallInts2 = Annotated[Array, _kind(np.int32, 2)]
Rows1 = Annotated[Array, _kind(np.uint32, 1)]
Bytes2 = Annotated[Array, _kind(np.uint8, 2)]
Flags1 = Annotated[Array, _kind(np.bool_, 1)]
Flags2 = Annotated[Array, _kind(np.bool_, 2)]


@cache
def _kinds(job: type) -> dict[str, _Kind]:
    """Kind of every field of a job."""
    kinds = {}
    for name, hint in get_type_hints(job, include_extras=True).items():
        is_array = get_origin(hint) is Annotated
        kinds[name] = get_args(hint)[1] if is_array else _kind(hint, -1)
    return kinds


def pack(job: NamedTuple) -> np.ndarray:
    """The job in main memory: numbers, and address and lengths of arrays. The arrays must outlive its use. int64

    Raises:
        TypeError: An array has another dtype or number of dimensions, or is not contiguous.
    """
    table: list[int] = []
    for (name, kind), value in zip(_kinds(type(job)).items(), job, strict=True):
        if kind.n_dimensions < 0:
            table.append(value if kind.dtype.kind == "i" else int(np.float64(value).view(np.int64)))
            continue
        if isinstance(value, Tensor):
            is_fit = value.dtype is kind.torch_dtype and value.is_contiguous()
        else:
            is_fit = value.dtype is kind.dtype and value.flags.c_contiguous
        if not is_fit or value.ndim != kind.n_dimensions:
            wanted = f"contiguous {kind.dtype} with {kind.n_dimensions} dimensions"
            raise TypeError(f"{name} must be {wanted}, got {value.dtype} {list(value.shape)}")
        table += (value.data_ptr() if isinstance(value, Tensor) else address_of(value), *value.shape)
    return np.array(table, np.int64)


def address_of(array: np.ndarray) -> int:
    """Address of the first value, 0 without values. `array.ctypes.data` takes three times as long."""
    if array.size == 0:
        return 0
    if not array.flags.writeable:
        return array.ctypes.data
    return ctypes.addressof(ctypes.c_char.from_buffer(array))  # pyright: ignore[reportArgumentType]


def job_reader(job: type) -> Any:
    """Signature and code of an intrinsic that reads a job from its address."""
    kinds = _kinds(job)
    fields: list[Any] = []
    for kind in kinds.values():
        scalar = from_dtype(kind.dtype)
        fields.append(scalar if kind.n_dimensions < 0 else types.Array(scalar, kind.n_dimensions, "C"))
    signature = types.NamedTuple(tuple(fields), job)(types.int64)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = 0

        def load_next(kind: Any = INT64) -> Any:
            nonlocal place
            address = builder.add(arguments[0], ir.Constant(INT64, place))
            place += 8
            return builder.load(builder.inttoptr(address, kind.as_pointer()))

        values = []
        for field in fields:
            if not isinstance(field, types.Array):
                values.append(load_next(context.get_value_type(field)))
                continue
            address = load_next()
            shape = [load_next() for _ in range(field.ndim)]
            item_bytes = context.get_abi_sizeof(context.get_data_type(field.dtype))
            strides = [ir.Constant(INT64, item_bytes)]
            for length in shape[:0:-1]:
                strides.insert(0, builder.mul(strides[0], length))
            array = make_array(field)(context, builder)
            populate_array(
                array,
                data=builder.inttoptr(address, context.get_data_type(field.dtype).as_pointer()),
                shape=cgutils.pack_array(builder, shape),
                strides=cgutils.pack_array(builder, strides),
                itemsize=ir.Constant(INT64, item_bytes),
                meminfo=None,
            )
            values.append(array._getvalue())
        return context.make_tuple(builder, signature.return_type, values)

    return signature, generate
