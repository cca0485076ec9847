"""Benchmarks: bench_*.py, each prints a table. Compiled kernels lie where the program keeps them."""

from engine.kernels.cache import use_kernel_cache

use_kernel_cache()
