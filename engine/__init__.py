"""Numbers and files of ClipGStream Studio; see ARCHITECTURE.md. Importing it changes nothing in the process.

A program that uses kernels calls `engine.kernels.cache.use_kernel_cache()` first, and
`engine.kernels.threads.configure_threads()`; without them numba keeps machine code next to the sources.
"""
