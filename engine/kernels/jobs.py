"""Jobs: what a kernel is given, as arrays and numbers on one side, and as one address on the other.

A job is a NamedTuple whose annotations say what a field is:

    int, float                the number
    Floats2, Ints1, ..        a contiguous array of this type and number of dimensions, an array in the kernel as well
    FloatsAt, IntsAt, ..      a contiguous array of any shape, in the kernel the address of its first value; None is 0
    ManyFloats, ManyBytes     a list of such arrays, in the kernel the address of a list of addresses
    Counter                   left out by the caller; in the kernel the address of an int64 that is zero at first
    Workers                   left out by the caller; in the kernel how many workers share the job

Arrays are numpy arrays or tensors. `pack` writes a job into main memory, which `engine.kernels.launch.launch` does;
`read(Job, address)` is the job again inside a kernel.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from enum import Enum
from functools import cache
from struct import Struct
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np
import torch
from llvmlite import ir
from numba import types
from numba.np.numpy_support import from_dtype
from torch import Tensor

from engine.kernels.lanes import INT64, kernel_intrinsic
from engine.kernels.numba_internals import array_value


class _Form(Enum):
    """How a field is passed."""

    NUMBER = "number"
    ARRAY = "array"
    ADDRESS = "address"
    ADDRESSES = "addresses"
    COUNTER = "counter"
    WORKERS = "workers"


class _Kind(NamedTuple):
    """A field's type: its form, dtype, the same for torch (None where torch has none), number of dimensions (-1 for
    any), and whether it holds whole numbers."""

    form: _Form
    dtype: np.dtype
    torch_dtype: torch.dtype | None
    n_dimensions: int
    is_whole: bool


def _kind(form: _Form, dtype: type[np.generic] = np.int64, n_dimensions: int = -1) -> _Kind:
    of_torch = getattr(torch, np.dtype(dtype).name, None)
    return _Kind(form, np.dtype(dtype), of_torch, n_dimensions, np.dtype(dtype).kind == "i")


_DOUBLE, _BITS = Struct("<d"), Struct("<q")


Array = np.ndarray | Tensor
Floats1 = Annotated[Array, _kind(_Form.ARRAY, np.float32, 1)]
Floats2 = Annotated[Array, _kind(_Form.ARRAY, np.float32, 2)]
Floats3 = Annotated[Array, _kind(_Form.ARRAY, np.float32, 3)]
Doubles1 = Annotated[Array, _kind(_Form.ARRAY, np.float64, 1)]
Doubles2 = Annotated[Array, _kind(_Form.ARRAY, np.float64, 2)]
Doubles3 = Annotated[Array, _kind(_Form.ARRAY, np.float64, 3)]
Ints1 = Annotated[Array, _kind(_Form.ARRAY, np.int64, 1)]
Ints2 = Annotated[Array, _kind(_Form.ARRAY, np.int64, 2)]
Ints3 = Annotated[Array, _kind(_Form.ARRAY, np.int64, 3)]
SmallInts1 = Annotated[Array, _kind(_Form.ARRAY, np.int32, 1)]
SmallInts2 = Annotated[Array, _kind(_Form.ARRAY, np.int32, 2)]
Rows1 = Annotated[Array, _kind(_Form.ARRAY, np.uint32, 1)]
Bytes2 = Annotated[Array, _kind(_Form.ARRAY, np.uint8, 2)]
Flags1 = Annotated[Array, _kind(_Form.ARRAY, np.bool_, 1)]
Flags2 = Annotated[Array, _kind(_Form.ARRAY, np.bool_, 2)]
FloatsAt = Annotated[Array | None, _kind(_Form.ADDRESS, np.float32)]
IntsAt = Annotated[Array | None, _kind(_Form.ADDRESS, np.int64)]
SmallIntsAt = Annotated[Array | None, _kind(_Form.ADDRESS, np.int32)]
ManyFloats = Annotated[Sequence[Array | None], _kind(_Form.ADDRESSES, np.float32)]
ManyBytes = Annotated[Sequence[Array | None], _kind(_Form.ADDRESSES, np.uint8)]
Counter = Annotated[None, _kind(_Form.COUNTER)]
Workers = Annotated[None, _kind(_Form.WORKERS)]


@cache
def _kinds(job: type) -> tuple[tuple[str, _Kind], ...]:
    """Name and kind of every field of a job."""
    kinds = []
    for name, hint in get_type_hints(job, include_extras=True).items():
        is_described = get_origin(hint) is Annotated
        kinds.append((name, get_args(hint)[1] if is_described else _kind(_Form.NUMBER, hint)))
    return tuple(kinds)


class Packed(NamedTuple):
    """A job in main memory.

    Attributes:
        table: Numbers, and addresses and lengths of arrays. int64
        held: Objects in the table apart from the arrays of the job. Job and list must outlive the use of the table.
    """

    table: np.ndarray
    held: list[np.ndarray]


def pack(job: NamedTuple, n_workers: int) -> Packed:
    """The job in main memory, with a fresh counter where it wants one.

    Raises:
        TypeError: An array has another dtype or number of dimensions, lies elsewhere than in main memory, or is not
            contiguous; or something stands where `launch` fills in.
    """
    table: list[int] = []
    held: list[np.ndarray] = []
    for (name, kind), value in zip(_kinds(type(job)), job, strict=True):
        form = kind.form
        if form is _Form.NUMBER:
            table.append(value if kind.is_whole else _BITS.unpack(_DOUBLE.pack(value))[0])
        elif form is _Form.ADDRESS:
            table.append(0 if value is None else _checked_address(name, kind, value))
        elif form is _Form.ARRAY:
            table.append(_checked_address(name, kind, value))
            table += value.shape
        elif form is _Form.ADDRESSES:
            held.append(np.array([0 if one is None else _checked_address(name, kind, one) for one in value], np.int64))
            table.append(address_of(held[-1]))
        elif value is not None:
            raise TypeError(f"{name} is filled in by launch and must be left out, got {value!r}")
        elif form is _Form.WORKERS:
            table.append(n_workers)
        else:
            held.append(np.zeros(1, np.int64))
            table.append(address_of(held[-1]))
    return Packed(np.array(table, np.int64), held)


def _checked_address(name: str, kind: _Kind, value: Array) -> int:
    """Address of an array of this kind."""
    if type(value) is np.ndarray:  # an isinstance of a tensor's class takes longer than all that follows
        if value.dtype is kind.dtype and value.flags.c_contiguous and kind.n_dimensions in (-1, value.ndim):
            return address_of(value)
    elif isinstance(value, Tensor) and value.dtype is kind.torch_dtype and value.is_contiguous() and value.is_cpu:
        if kind.n_dimensions in (-1, value.ndim):
            return value.data_ptr()
    elif value is None:
        raise TypeError(f"{name} must be an array, got None")
    wanted = f"contiguous {kind.dtype} in main memory"
    if kind.n_dimensions >= 0:
        wanted += f" with {kind.n_dimensions} dimensions"
    raise TypeError(f"{name} must be {wanted}, got {value.dtype} {list(value.shape)}")


def address_of(array: np.ndarray) -> int:
    """Address of the first value, 0 without values. `array.ctypes.data` takes three times as long."""
    try:
        return ctypes.addressof(ctypes.c_char.from_buffer(array))  # pyright: ignore[reportArgumentType]
    except (TypeError, ValueError):  # read-only, or without values
        return array.ctypes.data if array.size else 0


@kernel_intrinsic
def read(typing_context, job, address):
    """The job of a class at an address."""
    fields: list[Any] = []
    for _, kind in _kinds(job.instance_class):
        scalar = from_dtype(kind.dtype)
        if kind.form is _Form.ARRAY:
            fields.append(types.Array(scalar, kind.n_dimensions, "C"))
        else:
            fields.append(scalar if kind.form is _Form.NUMBER else types.int64)
    signature = types.NamedTuple(tuple(fields), job.instance_class)(job, types.int64)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = 0

        def load_next(kind: Any = INT64) -> Any:
            nonlocal place
            address = builder.add(arguments[1], ir.Constant(INT64, place))
            place += 8
            return builder.load(builder.inttoptr(address, kind.as_pointer()))

        values = []
        for field in fields:
            if isinstance(field, types.Array):
                address = load_next()
                shape = [load_next() for _ in range(field.ndim)]
                values.append(array_value(context, builder, field, address, shape))
            else:
                values.append(load_next(context.get_value_type(field)))
        return context.make_tuple(builder, signature.return_type, values)

    return signature, generate


def _view_at(dtype: Any) -> Any:
    """Signature and code of a one-dimensional array of this type at an address."""
    array = types.Array(dtype, 1, "C")

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return array_value(context, builder, array, arguments[0], [arguments[1]])

    return array(types.int64, types.int64), generate


@kernel_intrinsic
def floats_at(typing_context, address, n):
    """The n float32 at an address, as an array."""
    return _view_at(types.float32)


@kernel_intrinsic
def bytes_at(typing_context, address, n):
    """The n uint8 at an address, as an array."""
    return _view_at(types.uint8)
