"""What the kernels need of numba beyond its public interface, each looked at alone: says what an upgrade has broken.

`engine.kernels.numba_internals` is the only module to change then.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import llvmlite.binding as llvm
import numba
import numpy as np
import pytest
from numba import cfunc, njit, types
from numba.core import cgutils
from numba.np.numpy_support import from_dtype

from engine.kernels import numba_internals as internals
from engine.kernels.lanes import kernel_intrinsic

ROOT = Path(__file__).resolve().parents[3]


def explained(needed: str) -> str:
    """What a failure means."""
    return (
        f"{needed}: written for numba {internals.WRITTEN_FOR}, this is numba {numba.__version__}. "
        "Adapt engine/kernels/numba_internals.py, or pin numba to the version before."
    )


def _check(needed: str, look: Callable[[], object]) -> None:
    """Look at one internal; what it raises is told with what that means."""
    try:
        result = look()
    except Exception as error:
        error.add_note(explained(needed))
        raise
    assert result, explained(needed)


def test_numba_is_the_version_this_was_written_for():
    installed = ".".join(numba.__version__.split(".")[:2])
    assert installed == internals.WRITTEN_FOR, (
        f"numba {installed} is installed, the internals were tried with {internals.WRITTEN_FOR}: if all other tests of "
        "this file pass, raise WRITTEN_FOR in engine/kernels/numba_internals.py"
    )


def _seven(value):
    return value + 7.0


_PUBLISHED = internals.external("test_numba_internals.seven", types.float64(types.float64))


@njit
def _through_symbol(value):
    return _PUBLISHED(value)


def test_a_symbol_is_published_and_called():
    def look() -> bool:
        compiled = cfunc(types.float64(types.float64))(_seven)
        internals.publish("test_numba_internals.seven", compiled)
        return _through_symbol(1.0) == 8.0

    _check("types.ExternalFunction calls what llvmlite's add_symbol knows under its name", look)


@njit
def _helper(value):
    return _PUBLISHED(value)


def _names_a_helper(value):
    return _helper(value) + internals.WRITTEN_FOR


def test_called_symbols_are_found():
    _check(
        "co_names and globals of a function name what it calls, Dispatcher.py_func is what was jitted",
        lambda: list(internals.called_externals(_names_a_helper)) == ["test_numba_internals.seven"],
    )


@pytest.mark.slow
def test_the_loop_of_the_threading_layer_gives_every_number_once():
    probe = """
import ctypes, sys
from numba import get_num_threads
from engine.kernels import numba_internals as internals
from engine.kernels.lanes import kernel_intrinsic
get_num_threads()  # starts the threads
seen = (ctypes.c_int64 * 5)()
four = ctypes.CFUNCTYPE(None, *[ctypes.POINTER(ctypes.c_int64)] * 4)
def note(arrays, lengths, steps, data):
    first = ctypes.cast(arrays[0], ctypes.POINTER(ctypes.c_int64))
    for part in range(lengths[0]):
        seen[first[part * steps[0] // 8]] += data[0]
enter = four(note)
numbers = (ctypes.c_int64 * 5)(*range(5))
arrays = (ctypes.c_int64 * 1)(ctypes.addressof(numbers))
call = internals.parallel_for()
call(ctypes.cast(enter, ctypes.c_void_p).value, arrays, (ctypes.c_int64 * 1)(5), (ctypes.c_int64 * 1)(8),
     (ctypes.c_int64 * 1)(3), 0, 1, get_num_threads())
sys.exit(list(seen) != [3] * 5)
"""
    _check(
        "the symbol numba_parallel_for takes function, arrays, lengths, steps, data, inner dimensions, arrays, threads",
        lambda: subprocess.run([sys.executable, "-c", probe], cwd=ROOT, timeout=600).returncode == 0,
    )


def test_the_symbol_of_the_loop_is_there_once_threads_run():
    numba.get_num_threads()
    _check("llvmlite finds numba_parallel_for", lambda: llvm.address_of_symbol("numba_parallel_for"))


@kernel_intrinsic
def _nothing(typing_context):
    def generate(context, builder, signature, arguments):
        return None  # kernel_intrinsic makes it internals.no_value

    return types.void(), generate


@njit
def _does_nothing():
    _nothing()
    return 5


def test_an_intrinsic_may_return_nothing():
    _check("get_dummy_value is the value of an intrinsic that returns nothing", lambda: _does_nothing() == 5)


@kernel_intrinsic
def _matrix_at(typing_context, address, n_rows, n_columns):
    kind = types.Array(types.float32, 2, "C")

    def generate(context, builder, signature, arguments):
        return internals.array_value(context, builder, kind, arguments[0], list(arguments[1:]))

    return kind(types.int64, types.int64, types.int64), generate


@njit
def _double(address):
    values = _matrix_at(address, 2, 3)
    for row in range(values.shape[0]):
        for column in range(values.shape[1]):
            values[row, column] *= np.float32(2)
    return values.strides


def test_an_array_is_made_of_an_address():
    values = np.arange(6, dtype=np.float32).reshape(2, 3)

    def look() -> bool:
        return _double(values.ctypes.data) == (12, 4) and values.ravel().tolist() == [0, 2, 4, 6, 8, 10]

    _check("make_array and populate_array make an array of an address, lengths and strides", look)


def test_types_of_arrays_are_known_by_their_dtype():
    _check("from_dtype gives numba's type of a dtype", lambda: from_dtype(np.dtype(np.float32)) == types.float32)


def test_layer_and_most_threads_are_known():
    numba.get_num_threads()
    _check("threading_layer names the layer", lambda: internals.layer() in ("omp", "tbb", "workqueue"))
    _check("config.NUMBA_NUM_THREADS is the number of threads", lambda: internals.most_threads() >= 1)


@pytest.mark.slow
def test_a_layer_is_chosen_before_the_start():
    probe = (
        "from engine.kernels import numba_internals as i; assert i.layer() is None; i.choose_layer('workqueue'); "
        "from engine.kernels.launch import parallel_guard; parallel_guard(); assert i.layer() == 'workqueue'"
    )
    _check(
        "config.THREADING_LAYER chooses the layer of threads that were not started yet",
        lambda: subprocess.run([sys.executable, "-c", probe], cwd=ROOT, timeout=600).returncode == 0,
    )


def test_tools_of_code_generation_are_there():
    for name in ("alloca_once_value", "for_range", "get_or_insert_function", "pack_array", "raw_memcpy"):
        _check(f"numba.core.cgutils.{name}", lambda name=name: callable(getattr(cgutils, name)))


def test_nothing_else_touches_the_internals():
    pattern = re.compile(r"^\s*(?:from|import) (numba\.[\w.]+)", re.MULTILINE)
    found = set()
    for path in (ROOT / "engine").rglob("*.py"):
        for match in pattern.finditer(path.read_text("utf-8")):
            found.add((path.relative_to(ROOT).as_posix(), match[1]))
    allowed = {"numba.core", "numba.extending", "numba.np.numpy_support"}
    elsewhere = {f for f in found if f[0] != "engine/kernels/numba_internals.py" and f[1] not in allowed}
    assert not elsewhere
    assert ("engine/kernels/numba_internals.py", "numba.core.dispatcher") in found, "the search finds what is there"
