"""The fast rasterizer for main memory: numba kernels with explicit sixteen-lane vectors."""

from engine.raster.cpu.threads import configure_threads
from engine.raster.cpu.warm import warm_up

__all__ = ["configure_threads", "warm_up"]
