"""Portable numbers: what every library is told and obeys, who is refused, and which machines are of one kind."""

from __future__ import annotations

import json
import os
import platform
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from engine import portable
from engine.errors import EngineError
from engine.kernels.fast_math import ALL, CPU_VARIABLE, fast_math
from engine.portable import LEVEL, NATIVE, PORTABLE, cpu_kind, environment_of, portable_environment

ROOT = Path(__file__).resolve().parents[2]
V3 = "fpu sse4_2 avx avx2 fma bmi1 bmi2 f16c movbe abm"
INTEL = f"vendor_id\t: GenuineIntel\nmodel\t\t: 143\nmodel name\t: Xeon 9\nflags\t\t: {V3} avx512f\n"
AMD = f"vendor_id\t: AuthenticAMD\nmodel\t\t: 1\nmodel name\t: EPYC 9\nflags\t\t: {V3} sse4a\n"


@pytest.fixture
def on(monkeypatch: pytest.MonkeyPatch):
    """Makes this the machine of a text of the system's, of an architecture and a C library."""

    def put(text: str, machine: str = "x86_64", library: tuple[str, str] = ("glibc", "2.36")) -> None:
        monkeypatch.setattr(portable, "processor_text", lambda: text)
        monkeypatch.setattr(platform, "machine", lambda: machine)
        monkeypatch.setattr(platform, "libc_ver", lambda: library)

    return put


def run(code: str, **environment: str) -> str:
    command = [sys.executable, "-c", code]
    done = subprocess.run(
        command, env=os.environ | environment, capture_output=True, text=True, cwd=ROOT, check=False, timeout=900
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_kinds_of_machines(on) -> None:
    on(INTEL)
    intel, shared = cpu_kind(), cpu_kind(PORTABLE)
    assert intel.startswith("Xeon 9 (")
    assert cpu_kind() == intel
    on(INTEL.replace("avx512f", "avx512f amx_tile"))
    assert cpu_kind() != intel, "the same name with other instructions"
    assert cpu_kind(PORTABLE) == shared
    on(AMD)
    assert cpu_kind() != intel
    assert cpu_kind(PORTABLE) == shared == f"{LEVEL}, glibc 2.36"
    on(AMD, library=("glibc", "2.41"))
    assert cpu_kind(PORTABLE) != shared, "functions of another C library round differently"


def test_processors_below_the_level_are_refused_with_what_they_lack(on) -> None:
    on(INTEL.replace(" avx2 fma", ""))
    with pytest.raises(EngineError, match=r"level x86-64-v3, and this one lacks avx2, fma\. Train with --cpu native"):
        portable_environment()
    with pytest.raises(EngineError):
        cpu_kind(PORTABLE)
    on("Features\t: fp asimd\n", machine="aarch64")
    with pytest.raises(EngineError, match="is of the kind aarch64"):
        environment_of(PORTABLE)
    assert environment_of(NATIVE) == {}
    assert cpu_kind()
    on("", machine="AMD64")  # Windows lists no instructions
    assert portable_environment()


def test_kernels_get_no_estimates_where_numbers_are_portable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(CPU_VARIABLE, raising=False)
    assert fast_math(*ALL) == set(ALL)
    monkeypatch.setenv(CPU_VARIABLE, PORTABLE)
    assert fast_math(*ALL) == set(ALL) - {"arcp", "afn"}


def test_kernels_take_their_liberties_from_one_place() -> None:
    for path in (ROOT / "engine").rglob("*.py"):
        for line in path.read_text("utf-8").splitlines():
            is_free = re.search(r"fastmath\s*=\s*True|\"arcp\"|\"afn\"", line)
            assert not is_free or "fast_math(" in line or path.name == "fast_math.py", f"{path}: {line}"


def test_kept_kernels_are_of_one_choice(monkeypatch: pytest.MonkeyPatch) -> None:
    from engine.kernels.cache import current_key

    keys = []
    for environment in ({}, {CPU_VARIABLE: PORTABLE}):
        for name, value in environment.items():
            monkeypatch.setenv(name, value)
        current_key.cache_clear()
        keys.append(current_key())
    current_key.cache_clear()
    assert keys[0].libraries != keys[1].libraries


needs_level = pytest.mark.skipif(
    platform.machine() != "x86_64" or not sys.platform.startswith("linux"), reason="the level is one of x86-64"
)

ROOTS = """
import numpy as np
from numba import njit
from engine.kernels.fast_math import ALL, fast_math
@njit(fastmath=fast_math(*ALL))
def roots(x, out):
    for i in range(len(x)):
        out[i] = np.float32(1) / np.sqrt(x[i])
roots(np.ones(64, np.float32), np.ones(64, np.float32))
print(list(roots.inspect_asm().values())[0])
"""
OBEYED = """
import ctypes, glob, json, os, sys
import cv2, numba, numpy, torch
from pathlib import Path
libraries = Path(numpy.__file__).parents[1] / "numpy.libs"
blas = ctypes.CDLL(str(next(libraries.glob("libscipy_openblas*"))))
core = next(getattr(blas, name) for name in ("scipy_openblas_get_corename64_", "scipy_openblas_get_corename")
            if hasattr(blas, name))
core.restype = ctypes.c_char_p
print(json.dumps({
    "numba": numba.core.registry.cpu_target.target_context.codegen()._tm_features,
    "numpy": [name for name, has in numpy._core._multiarray_umath.__cpu_features__.items()
              if has and name in numpy._core._multiarray_umath.__cpu_dispatch__],
    "torch": torch.backends.cpu.get_cpu_capability(),
    "opencv": cv2.ipp.useIPP(),
    "openblas": core().decode(),
}))
"""


@needs_level
@pytest.mark.slow  # starts a process that imports numba and compiles
def test_compiled_code_holds_no_estimates() -> None:
    pinned = portable_environment()
    free = run(ROOTS, **{name: value for name, value in pinned.items() if name != CPU_VARIABLE})
    assert re.search("rsqrt|rcp", free), "otherwise this test shows nothing"
    assert not re.search("rsqrt|rcp", run(ROOTS, **pinned))


@needs_level
@pytest.mark.slow  # starts a process that imports every library
def test_every_library_obeys() -> None:
    found = json.loads(run(OBEYED, **portable_environment()))
    assert found == {
        "numba": "+avx2,+fma",
        "numpy": ["X86_V3"],
        "torch": "AVX2",
        "opencv": False,
        "openblas": "Haswell",
    }


@needs_level
@pytest.mark.slow  # emulates another maker's processor: a minute or two
@pytest.mark.skipif(shutil.which("qemu-x86_64") is None, reason="qemu-user is not installed")
@pytest.mark.parametrize("kind", ["EPYC", "Haswell"])
def test_an_emulated_processor_of_another_kind_gets_the_same_bits(kind: str) -> None:
    program = [sys.executable, "-m", "tests.engine.portable_numbers"]
    environment = os.environ | portable_environment() | {"OMP_NUM_THREADS": "1"}
    outputs = [
        subprocess.run(
            [*before, *program], env=environment, capture_output=True, text=True, cwd=ROOT, check=True, timeout=900
        ).stdout
        for before in ([], ["qemu-x86_64", "-cpu", kind])
    ]
    assert len(outputs[0].splitlines()) == 22
    assert outputs[1] == outputs[0]
