"""Numbers that are the same on processors of different makers and years, for a project that several machines train.

Every library on the way chooses its code by the processor it finds, and rounds differently with wider vectors. A
training amplifies a last bit to tenths of a decibel. `portable_environment` holds all of them to the instructions of
x86-64-v3 (AVX2 and FMA: Intel since 2013, AMD since 2015), which round alike everywhere. The C library's functions
already take these wherever they are found; decoders of video and pictures are exact with any instructions.

Libraries read their environment when they are loaded, so this is for processes that begin. Importing this module loads
nothing.
"""

from __future__ import annotations

import platform
from hashlib import blake2b
from typing import Literal

from engine.errors import EngineError
from engine.kernels import fast_math
from engine.machine import processor_text

Processor = Literal["native", "portable"]
"""Compute with all instructions that this processor has, or with those that any has."""
NATIVE: Processor = "native"
PORTABLE: Processor = "portable"
PROCESSORS: tuple[Processor, ...] = (NATIVE, PORTABLE)

LEVEL = "x86-64-v3"
_NEEDED = {"avx2", "fma", "bmi1", "bmi2", "f16c", "movbe", "abm"}
"""Of the level, as Linux names them; whoever has these has the rest."""
_ENVIRONMENT = {
    fast_math.CPU_VARIABLE: fast_math.PORTABLE,
    "NUMBA_CPU_NAME": LEVEL,
    "NUMBA_CPU_FEATURES": "+avx2,+fma",  # those of the name; without a word numba adds what it finds
    "NUMBA_DISABLE_INTEL_SVML": "1",  # chooses code by itself
    "ATEN_CPU_CAPABILITY": "avx2",
    "ONEDNN_MAX_CPU_ISA": "AVX2",
    "MKL_CBWR": "COMPATIBLE",  # the only one that MKL keeps on processors of other makers than its own
    "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR",
    "OPENBLAS_CORETYPE": "Haswell",  # numpy's, scipy's, OpenCV's and pycolmap's
    "OPENBLAS_NUM_THREADS": "1",  # machines also differ in their number of cores, by which it cuts sums
    "FAISS_SIMD_LEVEL": "AVX2",  # matches features inside pycolmap
    "OPENCV_CPU_DISABLE": "AVX512-SKX",
    "OPENCV_IPP": "disabled",  # has code for each generation of processors
}


def environment_of(processor: Processor) -> dict[str, str]:
    """Variables to add to the environment of a process that is to compute for this choice.

    Raises:
        EngineError: This machine cannot.
    """
    return portable_environment() if processor == PORTABLE else {}


def portable_environment() -> dict[str, str]:
    """Variables with which a process computes as on any other machine with these libraries.

    Raises:
        EngineError: This processor lacks what they stand on.
    """
    machine = platform.machine().lower()
    flags = _entry("flags").split()
    missing = _NEEDED - set(flags) if flags else set()  # systems that do not list them leave it to the user
    if machine not in ("x86_64", "amd64") or missing:
        lacking = f"lacks {', '.join(sorted(missing))}" if missing else f"is of the kind {machine}"
        raise EngineError(
            f"Portable numbers need a processor of level {LEVEL}, and this one {lacking}.",
            hint="Train with --cpu native, all clips on machines of one kind.",
        )
    return dict(_ENVIRONMENT)


def cpu_kind(processor: Processor = NATIVE) -> str:
    """The kind of this machine's processor, for comparison only: where two are equal, so are all numbers.

    The C library is part of it, since its functions round differently from version to version; versions of Python
    packages are not.

    Raises:
        EngineError: This machine cannot compute portably.
    """
    library = " ".join(part for part in platform.libc_ver() if part) or platform.system()
    if processor == PORTABLE:
        portable_environment()
        return f"{LEVEL}, {library}"
    name = _entry("model name") or platform.processor() or platform.machine()
    return f"{name} ({blake2b(processor_text().encode(), digest_size=4).hexdigest()}), {library}"


def _entry(name: str) -> str:
    """An entry of what the system says of the processor; empty where it has none."""
    lines = (line.partition(":") for line in processor_text().splitlines())
    return next((value.strip() for key, _, value in lines if key.strip() == name), "")
