"""Sixteen float32 lanes for numba: a small vocabulary in which the inner loops write explicit vector code.

numba has no vector type, and its automatic vectorisation loses half the speed of the blending loops. Inside an
`@intrinsic` one may emit LLVM IR, whose `<16 x float>` LLVM turns into one AVX-512, two AVX or four NEON registers.
`LaneBuilder` makes and moves such values, `Lanes` carries the arithmetic. Everything here runs while a kernel is being
compiled; nothing of it exists at run time. No knowledge of Gaussians lives here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils
from numba.extending import intrinsic

from engine.kernels.fast_math import fast_math
from engine.kernels.numba_internals import no_value

N_LANES = 16
VECTOR_BYTES = 4 * N_LANES

FLOAT = ir.FloatType()
INT32 = ir.IntType(32)
INT64 = ir.IntType(64)
FLOATS = ir.VectorType(FLOAT, N_LANES)
INTS = ir.VectorType(INT32, N_LANES)
_BOOL = ir.IntType(1)
_BOOLS = ir.VectorType(_BOOL, N_LANES)

# Rounding may be tightened (one rounding instead of two), infinities and NaN keep their meaning.
_FLAGS = tuple(sorted(fast_math("contract", "nsz", "arcp")))


def kernel_intrinsic(function: Callable[..., Any]) -> Any:
    """numba's `intrinsic`, typed by what it makes: kernels call the result without the leading typing context.

    What generates the code may return None where there is no value.
    """

    @wraps(function)
    def describe(*arguments: Any) -> Any:
        signature, generate = function(*arguments)

        def generate_value(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            value = generate(context, builder, signature, arguments)
            return no_value(context) if value is None else value

        return signature, generate_value

    return intrinsic(describe)


class LaneBuilder:
    """Emits vector instructions at the current position of an LLVM builder. Addresses are int64 byte addresses."""

    def __init__(self, builder: Any) -> None:
        self.ir: Any = builder

    # ---- making values
    def constant(self, value: float) -> Lanes:
        """The same number in every lane, rounded to float32."""
        return self.constants([value] * N_LANES)

    def constants(self, values: Sequence[float]) -> Lanes:
        """One number per lane, rounded to float32."""
        return Lanes(self, ir.Constant(FLOATS, [float(np.float32(value)) for value in values]))

    def broadcast(self, scalar: Any) -> Lanes:
        """A scalar float in every lane."""
        undefined = ir.Constant(FLOATS, ir.Undefined)
        first = self.ir.insert_element(undefined, scalar, ir.Constant(INT32, 0))
        return Lanes(self, self.ir.shuffle_vector(first, undefined, ir.Constant(INTS, [0] * N_LANES)))

    def int64(self, value: int) -> Any:
        """An int64 constant."""
        return ir.Constant(INT64, value)

    def scalar(self, value: float) -> Any:
        """A float constant."""
        return ir.Constant(FLOAT, float(np.float32(value)))

    # ---- memory
    def address(self, base: Any, offset: Any) -> Any:
        """`base` plus `offset` bytes; the offset may be a Python int or an int64 value."""
        return self.ir.add(base, self.int64(offset) if isinstance(offset, int) else offset)

    def load(self, base: Any, offset: Any = 0, align: int = VECTOR_BYTES) -> Lanes:
        """Sixteen consecutive floats."""
        pointer = self.ir.inttoptr(self.address(base, offset), FLOATS.as_pointer())
        return Lanes(self, self.ir.load(pointer, align=align))

    def store(self, lanes: Lanes, base: Any, offset: Any = 0, align: int = VECTOR_BYTES) -> None:
        """Sixteen consecutive floats."""
        pointer = self.ir.inttoptr(self.address(base, offset), FLOATS.as_pointer())
        self.ir.store(lanes.value, pointer, align=align)

    def load_masked(self, base: Any, keep: Any) -> Lanes:
        """Consecutive floats in the lanes of a mask, 0 in others; nothing else is read. 4-byte alignment is enough."""
        pointer_type = FLOATS.as_pointer()
        arguments = [self.ir.inttoptr(base, pointer_type), ir.Constant(INT32, 4), keep, self.constant(0.0).value]
        types = [pointer_type, INT32, _BOOLS, FLOATS]
        return Lanes(self, self._call("llvm.masked.load.v16f32.p0", FLOATS, arguments, types))

    def store_masked(self, lanes: Lanes, base: Any, keep: Any) -> None:
        """The lanes of a mask; nothing else is touched. 4-byte alignment is enough."""
        pointer_type = FLOATS.as_pointer()
        arguments = [lanes.value, self.ir.inttoptr(base, pointer_type), ir.Constant(INT32, 4), keep]
        self._call("llvm.masked.store.v16f32.p0", ir.VoidType(), arguments, [FLOATS, pointer_type, INT32, _BOOLS])

    def store_first(self, lanes: Lanes, n_lanes: int, base: Any) -> None:
        """Only the first `n_lanes` lanes. 4-byte alignment is enough."""
        self.store_masked(lanes, base, ir.Constant(_BOOLS, [int(lane < n_lanes) for lane in range(N_LANES)]))

    def load_scalar(self, base: Any, offset: Any = 0) -> Any:
        """One float."""
        return self.ir.load(self.ir.inttoptr(self.address(base, offset), FLOAT.as_pointer()))

    def prefetch(self, address: Any) -> None:
        """Hint that the cache line at an address is read soon. Never faults."""
        pointer_type = ir.IntType(8).as_pointer()
        hints = [ir.Constant(INT32, value) for value in (0, 3, 1)]  # to read, keep in all levels, data
        pointer = self.ir.inttoptr(address, pointer_type)
        self._call("llvm.prefetch.p0", ir.VoidType(), [pointer, *hints], [pointer_type, INT32, INT32, INT32])

    def gather(self, base: Any, rows: Any, row_floats: int, column: int) -> Lanes:
        """Element `column` of sixteen rows of a [N, row_floats] float32 array; `rows` is a vector of int32."""
        wide_type = ir.VectorType(INT64, N_LANES)
        pointers_type = ir.VectorType(FLOAT.as_pointer(), N_LANES)
        scaled = self.ir.mul(self.ir.sext(rows, wide_type), ir.Constant(wide_type, [4 * row_floats] * N_LANES))
        first = self.ir.insert_element(
            ir.Constant(wide_type, ir.Undefined), self.address(base, 4 * column), ir.Constant(INT32, 0)
        )
        bases = self.ir.shuffle_vector(first, ir.Constant(wide_type, ir.Undefined), ir.Constant(INTS, [0] * N_LANES))
        pointers = self.ir.inttoptr(self.ir.add(bases, scaled), pointers_type)
        arguments = [
            pointers,
            ir.Constant(INT32, 4),
            ir.Constant(_BOOLS, [1] * N_LANES),
            ir.Constant(FLOATS, [0.0] * N_LANES),
        ]
        types = [pointers_type, INT32, _BOOLS, FLOATS]
        return Lanes(self, self._call("llvm.masked.gather.v16f32.v16p0", FLOATS, arguments, types))

    def load_ints(self, base: Any, offset: Any = 0) -> Any:
        """Sixteen consecutive int32, 4-byte aligned."""
        return self.ir.load(self.ir.inttoptr(self.address(base, offset), INTS.as_pointer()), align=4)

    # ---- whole-vector operations
    def mask_bits(self, mask: Any) -> Any:
        """A comparison result as an int64 whose bit l is lane l."""
        return self.ir.zext(self.ir.bitcast(mask, ir.IntType(N_LANES)), INT64)

    def some_lane(self, mask: Any) -> Any:
        """1 if some lane of a comparison result is set, else 0, int64."""
        return self.ir.zext(self.ir.icmp_unsigned("!=", self.mask_bits(mask), self.int64(0)), INT64)

    def all_of(self, masks: Sequence[Any]) -> Any:
        """Lane-wise and."""
        result = masks[0]
        for mask in masks[1:]:
            result = self.ir.and_(result, mask)
        return result

    def transpose(self, rows: Sequence[Lanes]) -> list[Lanes]:
        """Sixteen vectors as a 16x16 matrix, transposed: four rounds of interleaving halves."""
        low = ir.Constant(INTS, [lane // 2 + N_LANES * (lane % 2) for lane in range(N_LANES)])
        high = ir.Constant(INTS, [8 + lane // 2 + N_LANES * (lane % 2) for lane in range(N_LANES)])
        values = [row.value for row in rows]
        for _ in range(4):
            values = [
                self.ir.shuffle_vector(values[pair], values[pair + 8], half)
                for pair in range(8)
                for half in (low, high)
            ]
        return [Lanes(self, value) for value in values]

    def sum_lanes(self, vectors: Sequence[Lanes]) -> Lanes:
        """Lane i of the result is the sum over the lanes of vectors[i]; at most sixteen vectors.

        Adds neighbours pairwise while packing two vectors into one, so all sums together cost one tree.
        """
        even = ir.Constant(INTS, list(range(0, 2 * N_LANES, 2)))
        odd = ir.Constant(INTS, list(range(1, 2 * N_LANES, 2)))
        zeros = ir.Constant(FLOATS, [0.0] * N_LANES)
        level: list[Any] = [vector.value for vector in vectors]
        for _ in range(4):
            packed = []
            for first in range(0, len(level), 2):
                left = level[first]
                right = level[first + 1] if first + 1 < len(level) else zeros
                evens = Lanes(self, self.ir.shuffle_vector(left, right, even))
                odds = Lanes(self, self.ir.shuffle_vector(left, right, odd))
                packed.append((evens + odds).value)
            level = packed
        return Lanes(self, level[0])

    # ---- control flow
    def for_each_bit(self, bits: Any, body: Callable[[Any], None]) -> None:
        """Run `body(index)` for every set bit of an int64, lowest first."""
        builder = self.ir
        rest_slot = cgutils.alloca_once_value(builder, bits)
        test, work, done = (builder.append_basic_block(name) for name in ("test", "work", "done"))
        builder.branch(test)
        builder.position_at_end(test)
        rest = builder.load(rest_slot)
        builder.cbranch(builder.icmp_unsigned("!=", rest, self.int64(0)), work, done)
        builder.position_at_end(work)
        index = self._call("llvm.cttz.i64", INT64, [rest, ir.Constant(_BOOL, 1)], [INT64, _BOOL])
        body(index)
        rest = builder.load(rest_slot)
        builder.store(builder.and_(rest, builder.sub(rest, self.int64(1))), rest_slot)
        builder.branch(test)
        builder.position_at_end(done)

    def call_unary(self, name: str, lanes: Lanes) -> Lanes:
        """An elementwise LLVM intrinsic such as sqrt, floor, ceil, log2, fabs."""
        return Lanes(self, self._call(f"llvm.{name}.v16f32", FLOATS, [lanes.value], [FLOATS]))

    def _call(self, name: str, result: Any, arguments: list[Any], types: list[Any]) -> Any:
        function = cgutils.get_or_insert_function(self.ir.module, ir.FunctionType(result, types), name)
        return self.ir.call(function, arguments)


class Lanes:
    """Sixteen float32 values with the usual operators. Plain numbers on the right are constants.

    `min`, `max` and comparisons are ordered: a NaN on the left loses, so `x.max(0)` is 0 for a NaN.
    """

    __slots__ = ("build", "value")

    def __init__(self, build: LaneBuilder, value: Any) -> None:
        self.build = build
        self.value = value

    def _other(self, other: Lanes | float) -> Any:
        return other.value if isinstance(other, Lanes) else self.build.constant(other).value

    def __add__(self, other: Lanes | float) -> Lanes:
        return Lanes(self.build, self.build.ir.fadd(self.value, self._other(other), flags=_FLAGS))

    def __sub__(self, other: Lanes | float) -> Lanes:
        return Lanes(self.build, self.build.ir.fsub(self.value, self._other(other), flags=_FLAGS))

    def __mul__(self, other: Lanes | float) -> Lanes:
        return Lanes(self.build, self.build.ir.fmul(self.value, self._other(other), flags=_FLAGS))

    def __truediv__(self, other: Lanes | float) -> Lanes:
        return Lanes(self.build, self.build.ir.fdiv(self.value, self._other(other), flags=_FLAGS))

    def __radd__(self, other: float) -> Lanes:
        return self + other

    def __rmul__(self, other: float) -> Lanes:
        return self * other

    def __rsub__(self, other: float) -> Lanes:
        return self.build.constant(other) - self

    def __rtruediv__(self, other: float) -> Lanes:
        return self.build.constant(other) / self

    def __neg__(self) -> Lanes:
        return Lanes(self.build, self.build.ir.fneg(self.value))

    def times_plus(self, factor: Lanes | float, summand: Lanes | float) -> Lanes:
        """self * factor + summand, fused where the machine can.

        Spelled out where two kernels must agree to the last bit: the backward pass replays decisions of the forward.
        """
        arguments = [self.value, self._other(factor), self._other(summand)]
        call = self.build._call("llvm.fmuladd.v16f32", FLOATS, arguments, [FLOATS] * 3)
        return Lanes(self.build, call)

    def compare(self, operator: str, other: Lanes | float) -> Any:
        """A mask; false wherever either side is NaN."""
        return self.build.ir.fcmp_ordered(operator, self.value, self._other(other))

    def min(self, other: Lanes | float) -> Lanes:
        """The smaller one; `other` where self is NaN."""
        return Lanes(self.build, self.build.ir.select(self.compare("<", other), self.value, self._other(other)))

    def max(self, other: Lanes | float) -> Lanes:
        """The larger one; `other` where self is NaN."""
        return Lanes(self.build, self.build.ir.select(self.compare(">", other), self.value, self._other(other)))

    def where(self, mask: Any, otherwise: Lanes | float = 0.0) -> Lanes:
        """self where the mask is set."""
        return Lanes(self.build, self.build.ir.select(mask, self.value, self._other(otherwise)))

    def sqrt(self) -> Lanes:
        """Square root; NaN below zero."""
        return self.build.call_unary("sqrt", self)

    def abs(self) -> Lanes:
        """Magnitude."""
        return self.build.call_unary("fabs", self)

    def floor(self) -> Lanes:
        """Largest whole number not above."""
        return self.build.call_unary("floor", self)

    def ceil(self) -> Lanes:
        """Smallest whole number not below."""
        return self.build.call_unary("ceil", self)

    def log2(self) -> Lanes:
        """Binary logarithm. One library call per lane: not for inner loops."""
        return self.build.call_unary("log2", self)

    def to_ints(self) -> Any:
        """Truncated to int32. Every lane must be in range: clamp first."""
        return self.build.ir.fptosi(self.value, INTS)
