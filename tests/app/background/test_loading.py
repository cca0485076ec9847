"""Loading large libraries: without holding the interpreter, and without the collector looking through them."""

from __future__ import annotations

import gc
import subprocess
import sys
import threading
from pathlib import Path
from types import ModuleType

import pytest

from app.background import libraries
from app.background.collector import uncollected
from app.background.libraries import load_libraries

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def collector():
    was_enabled = gc.isenabled()
    gc.enable()
    yield
    sys.modules.pop("this", None)
    gc.unfreeze()
    (gc.enable if was_enabled else gc.disable)()


def test_nothing_is_collected_while_modules_load_and_they_are_not_looked_at_again(collector: None):
    gc.unfreeze()
    with uncollected():
        pass
    assert gc.get_freeze_count() == 0, "nothing was loaded"
    sys.modules.pop("this", None)
    with uncollected():
        assert not gc.isenabled()
        kept = [[] for _ in range(100)]
        sys.modules["this"] = ModuleType("this")
    assert gc.isenabled()
    assert gc.get_freeze_count() >= len(kept)
    assert not any(one is kept[0] for one in gc.get_objects())


def test_the_last_thread_that_loads_lets_the_collector_go_on(collector: None):
    entered, may_leave = threading.Event(), threading.Event()

    def load() -> None:
        with uncollected():
            entered.set()
            assert may_leave.wait(300.0)

    thread = threading.Thread(target=load)
    with uncollected():
        thread.start()
        assert entered.wait(300.0)
    assert not gc.isenabled(), "the other one still loads"
    may_leave.set()
    thread.join()
    assert gc.isenabled()


def test_a_failing_import_lets_the_collector_go_on(collector: None):
    with pytest.raises(ImportError), uncollected():
        raise ImportError
    assert gc.isenabled()


def test_a_collector_that_was_off_stays_off(collector: None):
    gc.disable()
    with uncollected():
        pass
    assert not gc.isenabled()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_libraries_are_there_before_their_packages_and_the_packages_still_load():
    script = """
import sys
from pathlib import Path
from app.background.libraries import load_libraries
load_libraries()
maps = Path("/proc/self/maps").read_text()
for name in ("libtorch_cpu", "libllvmlite", "libscipy_openblas-"):
    assert name in maps, name
assert not {"torch", "llvmlite", "scipy", "av"} & set(sys.modules)
import llvmlite.binding, scipy.linalg, torch
before = sum("libtorch_cpu" in line for line in maps.splitlines())
after = sum("libtorch_cpu" in line for line in Path("/proc/self/maps").read_text().splitlines())
assert before == after, "not a second copy"
assert torch.ones(3).sum() == 3
assert scipy.linalg.det([[2.0]]) == 2.0
"""
    ended = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert ended.returncode == 0, ended.stderr


def test_what_is_missing_is_left_to_the_import(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    broken = tmp_path / "no_such_package_here" / "lib.so"
    broken.parent.mkdir()
    (broken.parent / "__init__.py").touch()
    broken.write_bytes(b"not a library")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(libraries, "_has_loaded", False)
    monkeypatch.setattr(libraries, "_LIBRARIES", (("no_such_package_here", "*.so"), ("nor_this_one", "*.so")))
    load_libraries()
    assert libraries._has_loaded
