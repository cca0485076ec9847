"""How many sixteen-lane multiply-adds this machine does per second: the ceiling of the kernels, measured.

The same `<16 x float>` values as in the kernels, twelve independent chains in registers, no memory: as fast as the
multiply-add ports can go at the clock the machine holds under such load.
"""

from __future__ import annotations

import time

import numpy as np
from numba import get_num_threads, njit, prange, types

from engine.kernels.lanes import LaneBuilder, kernel_intrinsic
from engine.kernels.launch import parallel_guard

_N_CHAINS = 12
"""Enough to hide the latency of two ports, few enough to stay in registers."""
_N_STEPS = 32
_ROUNDS_PER_CALL = 20_000


@kernel_intrinsic
def _multiply_add_round(typing_context, address):
    """_N_STEPS multiply-adds in each of the chains, which lie at `address`; returns the address."""
    signature = types.int64(types.int64)

    def generate(context, builder, signature, arguments):
        build = LaneBuilder(builder)
        factor, summand = build.constant(0.999), build.constant(0.001)
        chains = [build.load(arguments[0], 64 * chain) for chain in range(_N_CHAINS)]
        for _ in range(_N_STEPS):  # across the chains, so that neighbouring instructions do not wait for each other
            chains = [chain.times_plus(factor, summand) for chain in chains]
        for chain, value in enumerate(chains):
            build.store(value, arguments[0], 64 * chain)
        return arguments[0]

    return signature, generate


@njit(parallel=True, cache=True, nogil=True, error_model="numpy")
def _multiply_add(scratch, n_rounds):
    for worker in prange(len(scratch)):
        address = np.int64(scratch[worker].ctypes.data)
        for _ in range(n_rounds):
            _multiply_add_round(address)


def measure_fma_limit(*, seconds: float = 0.5) -> float:
    """Sixteen-lane multiply-adds per second of all threads that kernels use now, the best of several tries.

    Args:
        seconds: How long to measure, after a warm-up.
    """
    n_threads = get_num_threads()
    n_floats = 16 * _N_CHAINS
    raw = np.ones(n_threads * n_floats + 16, np.float32)
    start = (-raw.ctypes.data % 64) // 4
    scratch = raw[start : start + n_threads * n_floats].reshape(n_threads, n_floats)
    n_operations = n_threads * _ROUNDS_PER_CALL * _N_STEPS * _N_CHAINS
    best_s, until_s = float("inf"), time.perf_counter() + seconds
    with parallel_guard():
        _multiply_add(scratch, 10)
        while time.perf_counter() < until_s or best_s == float("inf"):
            started_s = time.perf_counter()
            _multiply_add(scratch, _ROUNDS_PER_CALL)
            best_s = min(best_s, time.perf_counter() - started_s)
    return n_operations / best_s
