"""Numbers and files of ClipGStream Studio; see ARCHITECTURE.md. Kernels are kept where `engine.kernel_cache` says."""

from engine.kernel_cache import use_kernel_cache

use_kernel_cache()  # numba asks for the folder when the decorator of a kernel runs
