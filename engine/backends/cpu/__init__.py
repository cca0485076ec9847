"""The default back end: numba kernels for float32 in main memory."""
