"""The fast rasterizer for main memory: numba kernels with explicit sixteen-lane vectors."""
