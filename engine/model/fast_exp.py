"""exp for float32 inside numba kernels, written so that LLVM vectorises it (math.exp is a scalar call)."""

from __future__ import annotations

import math

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

_LOG2E = np.float32(math.log2(math.e))
_LN2_HIGH = np.float32(0.693359375)  # ln 2 in two parts: the first has few bits, so k * high is exact
_LN2_LOW = np.float32(math.log(2) - 0.693359375)
_LOW, _HIGH = np.float32(-87.0), np.float32(88.0)  # beyond these float32 under- or overflows
_HALF = np.float32(0.5)
# Taylor coefficients 1/n!; |r| <= ln2 / 2 makes the first left-out term 1e-8
_C2, _C3, _C4, _C5, _C6, _C7 = (np.float32(1 / math.factorial(n)) for n in range(2, 8))
_ONE = np.float32(1)


@intrinsic
def _float_from_bits(_typing, _bits):
    """Reinterpret 32 integer bits as float32."""

    def generate(_context, builder, _signature, args):
        return builder.bitcast(args[0], ir.FloatType())

    return types.float32(types.int32), generate


@njit(inline="always")
def exp_float32(x):
    """exp(x), relative error below 2e-7; arguments are clamped to -87..88, NaN stays NaN."""
    clamped = min(max(x, _LOW), _HIGH)
    k = np.floor(clamped * _LOG2E + _HALF)
    r = clamped - k * _LN2_HIGH - k * _LN2_LOW
    p = _C7 * r + _C6
    p = p * r + _C5
    p = p * r + _C4
    p = p * r + _C3
    p = p * r + _C2
    p = p * r + _ONE
    p = p * r + _ONE
    bits = np.int32((np.int32(k) + np.int32(127)) << np.int32(23))
    power = _float_from_bits(bits)  # pyright: ignore[reportCallIssue] - numba passes the typing context itself
    return p * power if x == x else x
