"""The activations of the decode and their derivatives, on rows of a block.

For Gaussian k of an anchor at mu, with raw outputs o, c, (u, q), d:
    opacity = sigmoid(o);  color = sigmoid(c + color_logit);  scale = base * sigmoid(u);  quat = q;
    mean = mu + d * step,  with base = exp(log_base_scale) and step = exp(log_offset_scale).
The slow truth is `activate` in engine.backends.reference.decode.
"""

from __future__ import annotations

import math
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils

from engine.backends.cpu.decode.layout import BLOCK_VECTORS
from engine.kernels.lanes import FLOATS, INTS, N_LANES, VECTOR_BYTES, LaneBuilder, Lanes, kernel_intrinsic

_LN2_HIGH = 0.693359375  # ln 2 in two parts: the first has few bits, so k * high is exact
_LN2_LOW = math.log(2) - _LN2_HIGH
_LOWEST, _HIGHEST = -87.0, 88.0  # beyond these float32 under- or overflows
_TAYLOR = [1 / math.factorial(n) for n in range(8)]  # |r| <= ln2 / 2 makes the first left-out term 1e-8


def exp(x: Lanes) -> Lanes:
    """exp, relative error below 2e-7; arguments are clamped to -87..88, NaN stays NaN."""
    build, builder = x.build, x.build.ir
    clamped = x.max(_LOWEST).min(_HIGHEST)
    k = (clamped * math.log2(math.e) + 0.5).floor()
    rest = k.times_plus(-_LN2_LOW, k.times_plus(-_LN2_HIGH, clamped))
    value = build.constant(_TAYLOR[-1])
    for coefficient in reversed(_TAYLOR[:-1]):
        value = value.times_plus(rest, coefficient)
    bits = builder.shl(builder.add(k.to_ints(), ir.Constant(INTS, [127] * N_LANES)), ir.Constant(INTS, [23] * N_LANES))
    power = Lanes(build, builder.bitcast(bits, FLOATS))
    return (value * power).where(x.compare("==", x), x)


def sigmoid(x: Lanes) -> Lanes:
    """1 / (1 + exp(-x)); NaN stays NaN."""
    return 1.0 / (exp(-x) + 1.0)


def _on_rows(n_rows: int, compute: Any) -> Any:
    """Signature and code that runs `compute(build, loaded rows...)` on every vector of rows.

    Of the n_rows addresses the last is written, and read before as the others are.
    """
    signature = types.void(*[types.int64] * n_rows)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        build = LaneBuilder(builder)
        for vector in range(BLOCK_VECTORS):
            offset = VECTOR_BYTES * vector
            result = compute(*(build.load(address, offset) for address in arguments))
            build.store(result, arguments[-1], offset)

    return signature, generate


@kernel_intrinsic
def exp_row(typing_context, x, out):
    """out = exp(x)"""
    return _on_rows(2, lambda x, _: exp(x))


@kernel_intrinsic
def exp_negated_row(typing_context, x, out):
    """out = exp(-x)"""
    return _on_rows(2, lambda x, _: exp(-x))


@kernel_intrinsic
def sigmoid_row(typing_context, x, out):
    """out = sigmoid(x)"""
    return _on_rows(2, lambda x, _: sigmoid(x))


@kernel_intrinsic
def shifted_sigmoid_row(typing_context, x, shift, out):
    """out = sigmoid(x + shift)"""
    return _on_rows(3, lambda x, shift, _: sigmoid(x + shift))


@kernel_intrinsic
def scaled_sigmoid_row(typing_context, x, factor, out):
    """out = factor * sigmoid(x)"""
    return _on_rows(3, lambda x, factor, _: factor * sigmoid(x))


@kernel_intrinsic
def times_plus_row(typing_context, x, factor, summand, out):
    """out = x * factor + summand"""
    return _on_rows(4, lambda x, factor, summand, _: x.times_plus(factor, summand))


@kernel_intrinsic
def times_row(typing_context, x, factor, out):
    """out = x * factor"""
    return _on_rows(3, lambda x, factor, _: x * factor)


@kernel_intrinsic
def add_product_row(typing_context, x, factor, out):
    """out += x * factor"""
    return _on_rows(3, lambda x, factor, out: x.times_plus(factor, out))


@kernel_intrinsic
def copy_row(typing_context, x, out):
    """out = x"""
    return _on_rows(2, lambda x, _: x)


@kernel_intrinsic
def zero_row(typing_context, out):
    """out = 0"""
    return _on_rows(1, lambda out: out.build.constant(0.0))


@kernel_intrinsic
def where_positive_row(typing_context, x, out):
    """out becomes 0 where x is not positive"""
    return _on_rows(2, lambda x, out: out.build.constant(0.0).where(x.compare("<=", 0.0), out))


@kernel_intrinsic
def d_sigmoid_row(typing_context, d_value, value, out):
    """out = d_value * value * (1 - value), for value = sigmoid(x)"""
    return _on_rows(3, lambda d_value, value, _: d_value * value * (1.0 - value))


@kernel_intrinsic
def d_scaled_sigmoid_row(typing_context, d_value, value, inverse_factor, out):
    """out = d_value * value * (1 - value / factor), for value = factor * sigmoid(x)"""
    return _on_rows(4, lambda d_value, value, inverse, _: d_value * value * (1.0 - value * inverse))


@kernel_intrinsic
def add_row_sum(typing_context, x, out):
    """out[lane] += the sum of the row's vectors: sixteen partial sums of a row. `out` is one vector."""
    signature = types.void(types.int64, types.int64)

    def generate(context, builder, signature, arguments):
        build = LaneBuilder(builder)
        vectors = [build.load(arguments[0], VECTOR_BYTES * vector) for vector in range(BLOCK_VECTORS)]
        build.store(build.load(arguments[1]) + ((vectors[0] + vectors[1]) + (vectors[2] + vectors[3])), arguments[1])

    return signature, generate


@kernel_intrinsic
def add_others(typing_context, first, step, n):
    """The vector at `first` += those at first + step, first + 2 step, .. of n altogether, in order."""
    signature = types.void(*[types.int64] * 3)

    def generate(context, builder, signature, arguments):
        first, step, n = arguments
        build = LaneBuilder(builder)
        total = cgutils.alloca_once_value(builder, build.load(first).value)
        with cgutils.for_range(builder, builder.sub(n, build.int64(1))) as loop:
            place = builder.add(first, builder.mul(step, builder.add(loop.index, build.int64(1))))
            builder.store((Lanes(build, builder.load(total)) + build.load(place)).value, total)
        build.store(Lanes(build, builder.load(total)), first)

    return signature, generate
