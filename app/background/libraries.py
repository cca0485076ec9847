"""Large libraries, loaded without holding the interpreter.

Python keeps its lock while it opens an extension module, and so while the system reads, links and initialises all
libraries that the module needs: half a second for torch's 430 MB where they lie in memory, several where they have to
come from a disk. A window whose thread waits for the lock stands still. Opened beforehand by a plain call of the
system's loader, for which the lock is given up, they are already there when the module asks for them.
"""

from __future__ import annotations

import ctypes
import importlib.util
import logging
import os
import sys
import threading
from pathlib import Path

logger = logging.getLogger(__name__)

_LIBRARIES = (
    ("torch", "lib/libtorch_global_deps.*"),
    ("torch", "lib/libtorch_cpu.*"),
    ("llvmlite", "binding/libllvmlite.*"),
    ("scipy", "../scipy.libs/libscipy_openblas*"),
    ("av", "../av.libs/libavcodec*"),
)
"""Package, and where a library of it lies. None of these knows Python."""
_SUFFIXES = (".so", ".dylib")
_lock = threading.Lock()
_has_loaded = False


def load_libraries() -> None:
    """Open the libraries of torch, numba, scipy and av. Blocks the calling thread alone; a library that does not open
    is left to the import, which says why. Does nothing the second time, nor on Windows."""
    global _has_loaded
    with _lock:
        if _has_loaded or sys.platform == "win32":
            return
        _has_loaded = True
        for package, pattern in _LIBRARIES:
            for path in _found(package, pattern):
                _open(path)


def _found(package: str, pattern: str) -> list[Path]:
    if package in sys.modules:
        return []
    try:
        spec = importlib.util.find_spec(package)
    except (ImportError, ValueError):
        return []
    folders = [] if spec is None else list(spec.submodule_search_locations or ())
    return [
        path
        for folder in folders
        for path in sorted(Path(folder).parent.glob(os.path.normpath(f"{Path(folder).name}/{pattern}")))
        if any(suffix in path.name for suffix in _SUFFIXES)
    ]


def _open(path: Path) -> None:
    loader = ctypes.CDLL(None).dlopen  # ctypes.CDLL(path) itself keeps the lock; a foreign function does not
    loader.argtypes, loader.restype = (ctypes.c_char_p, ctypes.c_int), ctypes.c_void_p
    if not loader(os.fsencode(path), os.RTLD_NOW | os.RTLD_LOCAL):
        logger.debug("%s could not be opened ahead of time", path)
