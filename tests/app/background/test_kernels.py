"""Kernels as the program uses them: progress while they are compiled, and what the doctor says about them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from app.background import kernels
from app.cli import doctor
from app.cli.doctor import vector_width
from engine.kernels.cache import UNWRITABLE, CacheState, kernel_folder
from engine.progress import Progress

ROOT = Path(__file__).resolve().parents[3]
FOLDER = Path("somewhere") / "kernels-0"


def state(**changes: object) -> CacheState:
    return CacheState(folder=FOLDER, is_warm=True, reason="", is_fallback=False, n_bytes=3 << 20)._replace(**changes)


@pytest.mark.parametrize(
    ("found", "words", "is_fine"),
    [
        (state(), ("compiled, in", str(FOLDER), "3.0 MB"), True),
        (state(is_warm=False, reason="never compiled"), ("not compiled: never compiled", "some seconds longer"), True),
        (state(is_warm=False, reason="sources changed"), ("not compiled: sources changed",), True),
        (state(is_warm=False, reason="other CPU"), ("not compiled: other CPU",), True),
        (state(is_warm=False, reason=UNWRITABLE), ("not compiled: folder not writable",), False),
        (state(is_fallback=True), ("compiled", "temporary folder", "cannot be written"), False),
    ],
)
def test_the_doctor_says_what_the_cache_holds(monkeypatch, found, words, is_fine):
    monkeypatch.setattr(doctor, "cache_state", lambda: found)
    finding = doctor._kernels()
    assert finding.is_fine is is_fine
    assert [word for word in words if word not in finding.text] == []


@pytest.mark.parametrize(
    ("features", "machine", "expected"),
    [
        ({"sse2", "avx", "avx2", "avx512f"}, "x86_64", ("AVX-512", 16)),
        ({"sse2", "avx", "avx2"}, "x86_64", ("AVX2", 8)),
        ({"sse2"}, "x86_64", ("SSE", 4)),
        ({"neon"}, "aarch64", ("NEON", 4)),
        (set(), "arm64", ("NEON", 4)),
        (set(), "riscv64", ("no vector instructions known", 1)),
    ],
)
def test_widest_vectors(features, machine, expected):
    assert vector_width(features, machine) == expected


def test_the_doctor_names_vectors_and_threads():
    vectors, threads = doctor._vectors(), doctor._threads()
    assert "16 lanes" in vectors.text
    assert "layer omp" in threads.text or "layer" in threads.text
    assert "GOMP_SPINCOUNT" in threads.text
    assert threads.text.split(",")[0].isdigit()


def test_compiling_reports_groups_and_says_each_once(monkeypatch):
    def compile_all(report, *, backend):
        for done, n, what in ((0, 2, "a and b"), (0, 2, "a and b"), (1, 2, "b"), (1, 2, "b"), (2, 2, "")):
            report(done, n, what)

    monkeypatch.setattr(kernels, "compile_all", compile_all)
    said: list[Progress] = []
    kernels.warm_up_reporting(said.append)
    assert {progress.stage for progress in said} == {kernels.COMPILING}
    assert [progress.done for progress in said] == [0.0, 0.0, 0.5, 0.5, 1.0]
    assert [progress.message[:6] for progress in said if progress.message] == ["1 of 2", "2 of 2"]


def test_failing_to_start_processes_is_no_failure(monkeypatch, caplog):
    def refuse(*, backend: str) -> bool:
        raise OSError("no more processes")

    monkeypatch.setattr(kernels, "compile_all", refuse)
    kernels.warm_cache()
    assert "no more processes" in caplog.text


WINDOW = """
from ui import main
main.has_display = lambda: {display}
main._run_window = main._run_demo = tell
main.main({arguments})
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "start",
    [
        "from app.cli import cli; cli.main(['inspect', 'nowhere']); tell()",
        WINDOW.format(display=True, arguments=[]),
        WINDOW.format(display=False, arguments=[]),
        WINDOW.format(display=True, arguments=["demo"]),
    ],
)
def test_whoever_owns_the_process_chooses_the_folder_of_kernels_before_numba_is_there(start):
    tell = "import os, sys; tell = lambda *_: print(os.environ['NUMBA_CACHE_DIR'], 'numba' in sys.modules) or 0\n"
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA")}
    done = subprocess.run(
        [sys.executable, "-c", tell + start], cwd=ROOT, capture_output=True, text=True, check=False, env=environment
    )
    assert done.stdout.split() == [str(kernel_folder()), "False"], done.stderr
