"""The rasterizer's compiled kernels: whether they are in the cache, and compiling them where no window waits.

Compiling holds the interpreter lock for about ten seconds, so it never happens in a process with a window.
"""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

from engine.conventions import SPIN_COUNT

logger = logging.getLogger(__name__)

WARM_UP = "from engine.raster.cpu.warm import warm_up; warm_up()"
TIME_LIMIT_S = 180.0


def is_cache_warm() -> bool:
    """Whether compiled kernels of the rasterizer lie in numba's cache."""
    spec = find_spec("engine.raster.cpu")
    if spec is None or spec.origin is None:
        return False
    folders = [Path(spec.origin).parent / "__pycache__"]
    if os.environ.get("NUMBA_CACHE_DIR"):
        folders = [Path(os.environ["NUMBA_CACHE_DIR"])]
    return any(next(folder.rglob("blend*.nbi"), None) is not None for folder in folders if folder.is_dir())


def warm_cache() -> None:
    """Compile in a process of its own, if nothing is cached yet. Blocks until it is done; failing is no failure."""
    if is_cache_warm():
        return
    root = str(Path(__file__).resolve().parent.parent)
    path = os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH", ""))))
    try:
        subprocess.run(
            [sys.executable, "-c", WARM_UP],
            env={**os.environ, "PYTHONPATH": path},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=TIME_LIMIT_S,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        logger.warning("kernels could not be compiled ahead: %s", error)


def use_threads(n_threads: int | None) -> int:
    """Set how many threads the calling thread computes with; None for every core. Returns how many it will be.

    To be called before torch is imported where that is possible: OpenMP reads its environment when it is loaded, so
    the spin count is set here and not only in configure_threads, whose module imports torch.
    """
    os.environ.setdefault("GOMP_SPINCOUNT", str(SPIN_COUNT))
    from engine.raster.cpu.threads import configure_threads

    return configure_threads(n_threads)


def prepare_drawing() -> None:
    """Once on a thread that draws: compiled kernels, one core, and everything loaded that a first picture needs."""
    warm_cache()
    use_threads(1)
    if is_cache_warm():
        from engine.raster.cpu.warm import warm_up

        warm_up()


def prepare_decoding() -> None:
    """Once on a thread that decodes: one core, and everything loaded that a first frame needs."""
    import engine.model.clip_model  # noqa: F401

    use_threads(1)
