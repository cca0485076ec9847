"""Numbers and files of ClipGStream Studio; see ARCHITECTURE.md. Kernels are kept where `engine.kernels.cache` says."""

from engine.kernels.cache import use_kernel_cache

use_kernel_cache()  # numba asks for the folder when the decorator of a kernel runs
