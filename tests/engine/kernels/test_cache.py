"""The folder of compiled kernels: its key, its marker, where it goes when the user's cache cannot be written."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from unittest.mock import Mock

import pytest
from filelock import FileLock

from engine.kernels import cache
from engine.kernels import compile_ahead as warm
from engine.kernels.cache import (
    MARKER,
    MAX_FOLDERS,
    UNWRITABLE,
    CacheKey,
    cache_state,
    current_key,
    is_cache_warm,
    kernel_sources,
    prune,
    read_marker,
    sources_hash,
    use_kernel_cache,
    write_marker,
)

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An empty cache of the test's own; numba's setting of this process comes back afterwards."""
    from numba.core import config

    monkeypatch.setattr(config, "CACHE_DIR", getattr(config, "CACHE_DIR", ""))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path / "cache"))
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")  # so that it is put back, whether it was set or not
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A small engine: a kernel, a helper it imports, a package that re-exports one more, routines, and a stranger."""
    folder = tmp_path / "engine"
    sources = {
        "__init__.py": "",
        "a/__init__.py": "",
        "a/kernel.py": "import numba\nfrom engine.a.helper import f\nfrom engine.b import g\n@numba.njit\ndef k(): 0\n",
        "a/helper.py": "from engine import constants as c\n\nf = c\n",
        "b/__init__.py": "from engine.b.inner import (\n    g,\n)\n",
        "b/inner.py": "g = 1\n",
        "constants.py": "X = 1\n",
        "a/warm.py": "from engine.stranger import k\n",
        "c/cpu/backend.py": "from engine.c.cpu.routines import r\n",
        "c/cpu/routines.py": "from engine.c.layout import N\n@routine(N)\ndef r(): 0\n",
        "c/layout.py": "N = 1\n",
        "kernels/memory.py": "",
        "stranger.py": "from engine.a.kernel import k\n",
    }
    for name, text in sources.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def marked_folder(root: Path, name: str, key: CacheKey, *, age_s: float) -> Path:
    """A folder of another version with its marker."""
    import json

    folder = root / name
    folder.mkdir(parents=True)
    (folder / MARKER).write_text(json.dumps(key._asdict()))
    when_s = 1_700_000_000 - age_s
    os.utime(folder / MARKER, (when_s, when_s))
    return folder


# ---------------------------------------------------------------- the key


def test_sources_are_the_kernels_and_what_they_import(package):
    expected = {"a/helper.py", "a/kernel.py", "a/warm.py", "b/__init__.py", "b/inner.py", "constants.py"}
    expected |= {"c/cpu/backend.py", "c/cpu/routines.py", "c/layout.py", "kernels/memory.py"}
    assert list(kernel_sources(package)) == sorted(expected)


@pytest.mark.parametrize(
    "name",
    ["a/kernel.py", "a/helper.py", "a/warm.py", "b/inner.py", "constants.py", "c/cpu/routines.py", "c/layout.py"],
)
def test_a_changed_source_changes_the_key(package, name):
    before = sources_hash(package)
    with (package / name).open("a") as file:
        file.write("# changed\n")
    assert sources_hash(package) != before


def test_what_no_kernel_imports_does_not_change_the_key(package):
    before = sources_hash(package)
    (package / "stranger.py").write_text("print()\n")
    assert sources_hash(package) == before


def real_kernel_files() -> list[str]:
    """Files of the engine that hold kernels, and all files beside them in the folders of kernels."""
    engine = ROOT / "engine"
    decorators = ("njit", "routine(", "kernel_intrinsic", "intrinsic")
    held = {
        path for path in engine.rglob("*.py") if any(f"\n@{name}" in path.read_text("utf-8") for name in decorators)
    }
    for folder in ("kernels", "backends/cpu/raster", "backends/cpu/decode", "backends/cpu/step"):
        held.update((engine / folder).glob("*.py"))
    return sorted(path.relative_to(engine).as_posix() for path in held)


@pytest.mark.slow
def test_a_change_of_any_real_kernel_file_changes_the_key(monkeypatch):
    changed = ""
    texts_on_disk = cache._python_texts

    def texts(package: str) -> dict[str, bytes]:
        found = texts_on_disk(package)
        return {**found, changed: found[changed] + b"# changed\n"} if changed else found

    monkeypatch.setattr(cache, "_python_texts", texts)
    before = sources_hash(ROOT / "engine")
    names = real_kernel_files()
    assert {"kernels/lanes.py", "backends/cpu/decode/forward.py", "cloud/motion/hull.py"} <= set(names)
    assert {"backends/cpu/step/fused_loss.py", "images/ssim_lanes.py", "backends/cpu/step/adam.py"} <= set(names)
    unnoticed = []
    for changed in [*names, "conventions.py", "backends/cpu/decode/warm.py"]:
        if sources_hash(ROOT / "engine") == before:
            unnoticed.append(changed)
    assert not unnoticed


def test_the_package_is_the_engine():
    assert current_key().sources == sources_hash(ROOT / "engine")


def test_settings_of_numba_that_change_code_change_the_key(monkeypatch):
    before = current_key()
    current_key.cache_clear()
    monkeypatch.setenv("NUMBA_BOUNDSCHECK", "1")
    try:
        assert current_key().libraries != before.libraries
    finally:
        current_key.cache_clear()


# ---------------------------------------------------------------- where the folder is


def test_the_folder_lies_in_the_users_cache_and_reaches_numba(tmp_path):
    from numba.core import config

    folder = use_kernel_cache()
    assert folder.parent.name == "ClipGStream"
    assert folder.is_relative_to(tmp_path)
    assert os.environ["NUMBA_CACHE_DIR"] == str(folder)
    assert str(folder) == config.CACHE_DIR  # pyright: ignore[reportAttributeAccessIssue]
    assert not folder.exists(), "looking for the folder makes nothing"


def test_a_folder_of_the_user_wins(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "mine"))
    assert use_kernel_cache() == tmp_path / "mine"
    assert os.environ["NUMBA_CACHE_DIR"] == str(tmp_path / "mine")


def test_an_inherited_folder_of_our_own_is_worked_out_again(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache" / "ClipGStream" / "kernels-0123456789abcdef"))
    assert use_kernel_cache().name == current_key().folder_name


def test_an_unwritable_home_falls_back_to_a_temporary_folder(tmp_path):
    (tmp_path / "cache").write_text("a file where the folder should be")
    folder = use_kernel_cache()
    assert folder.is_relative_to(tmp_path / "temporary")
    assert folder.parent.stat().st_mode & 0o077 == 0
    assert cache_state().is_fallback
    assert use_kernel_cache() == folder


def test_a_temporary_folder_that_others_may_write_to_is_not_taken(tmp_path):
    (tmp_path / "cache").write_text("a file where the folder should be")
    shared = cache.fallback_root()
    shared.chmod(0o777)
    folder = use_kernel_cache()
    assert folder.parent != shared
    assert folder.is_relative_to(tmp_path / "temporary")
    assert use_kernel_cache() == folder, "one folder for a process and its children, not one for each call"


def test_no_home_at_all_is_no_failure(monkeypatch):
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.delenv("HOME", raising=False)
    monkeypatch.setattr("pwd.getpwuid", Mock(side_effect=KeyError("no such user")))
    monkeypatch.setattr(cache, "_is_writable", lambda folder: False)
    assert use_kernel_cache().is_relative_to(tempfile.gettempdir())


IMPORTS = """
import os
before = dict(os.environ)
import engine, engine.kernels.cache, engine.kernels.compile_ahead, engine.errors
assert "numba" not in __import__("sys").modules
import numba, torch
between = dict(os.environ)
import engine.kernels.threads, engine.cloud.stereo.depth.sweep, engine.cloud.voxel  # which compile nothing yet
after = dict(os.environ)
from numba.core import config
print(sorted(set(after.items()) ^ set(between.items())), repr(config.CACHE_DIR))
print([name for name in after if name.startswith(("NUMBA", "GOMP")) and name not in before])
print(engine.kernels.cache.current_key.cache_info().currsize)
"""


@pytest.mark.slow
def test_importing_engine_leaves_the_process_as_it_is():
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("NUMBA", "GOMP"))}
    done = subprocess.run(
        [sys.executable, "-c", IMPORTS], cwd=ROOT, capture_output=True, text=True, check=False, env=environment
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == ["[] ''", "[]", "0"]  # no setting, no folder, no hash of the sources


# ---------------------------------------------------------------- the marker


def test_a_marker_of_this_key_means_warm(tmp_path):
    folder = use_kernel_cache()
    assert not is_cache_warm()
    assert cache_state().reason == "never compiled"
    write_marker(folder)
    assert is_cache_warm()
    state = cache_state()
    assert (state.is_warm, state.reason, state.is_fallback) == (True, "", False)
    assert state.n_bytes > 0


@pytest.mark.parametrize("text", ["", "{}", "[1]", '{"sources": 1}', "\x00"])
def test_a_damaged_marker_is_none(text):
    folder = use_kernel_cache()
    folder.mkdir(parents=True)
    (folder / MARKER).write_text(text)
    assert read_marker(folder) is None
    assert not is_cache_warm()


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"sources": "x"}, "sources changed"),
        ({"processor": "x"}, "other CPU"),
        ({"libraries": "x"}, "other versions of numba, llvmlite or Python"),
        ({"sources": "x", "processor": "x"}, "sources and libraries changed"),
    ],
)
def test_the_reason_names_what_differs(changes, reason):
    folder = use_kernel_cache()
    marked_folder(folder.parent, "kernels-other", current_key()._replace(**changes), age_s=0)
    assert cache_state().reason == reason


def test_an_unwritable_folder_is_the_reason(monkeypatch, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(blocked / "below"))
    state = cache_state()
    assert (state.is_warm, state.reason) == (False, UNWRITABLE)
    write_marker(blocked / "below")  # fails in silence
    assert not is_cache_warm()


def test_old_folders_are_pruned_to_the_newest(tmp_path):
    root = tmp_path / "root"
    key = CacheKey("a", "b", "c")
    folders = [marked_folder(root, f"kernels-{i}", key, age_s=100.0 * i) for i in range(5)]
    (root / "something else").mkdir()
    prune(root, keep=folders[4])  # the oldest is the one in use
    assert sorted(path.name for path in root.iterdir()) == ["kernels-0", "kernels-1", "kernels-4", "something else"]
    assert MAX_FOLDERS == 3


# ---------------------------------------------------------------- compiling ahead


@pytest.fixture
def small_groups(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Replaces the real groups by modules that take no time; gives a function that makes them."""

    def make(**bodies: str) -> None:
        folder = tmp_path / "warm_modules"
        folder.mkdir()
        for name, body in bodies.items():
            (folder / f"warm_{name}.py").write_text(f"def warm_up():\n    {body}\n")
        monkeypatch.setenv("PYTHONPATH", str(folder))
        monkeypatch.syspath_prepend(str(folder))
        monkeypatch.setattr(warm, "GROUPS", tuple((name, f"warm_{name}", 1.0) for name in bodies))

    return make


def test_compiling_runs_every_group_and_leaves_a_marker(small_groups, tmp_path):
    small_groups(
        one=f"open({str(tmp_path / '1')!r}, 'w').close()",
        two=f"open({str(tmp_path / '2')!r}, 'w').close()",
        three="pass",
    )
    said = []
    assert warm.compile_all(lambda done, n, what: said.append((done, n)), n_processes=2)
    assert (tmp_path / "1").exists()
    assert (tmp_path / "2").exists()
    assert is_cache_warm()
    assert said[0] == (0, 3)
    assert said[-1] == (3, 3)
    assert is_free(use_kernel_cache() / warm.LOCK)


HOLDER = """
import sys
from filelock import FileLock
lock = FileLock(sys.argv[1])
lock.acquire()
print("held", flush=True)
sys.stdin.read()
"""


def is_free(path: Path) -> bool:
    """Whether nobody holds the lock."""
    lock = FileLock(path)
    with lock.acquire(blocking=False):
        return lock.is_locked


def test_a_warm_cache_starts_no_process(small_groups):
    small_groups(never="raise SystemExit(1)")
    write_marker(use_kernel_cache())
    assert warm.compile_all(lambda *said: pytest.fail("there was nothing to compile"))


def test_a_group_that_fails_leaves_no_marker(small_groups, caplog):
    small_groups(good="pass", bad="raise ValueError('no such kernel')")
    assert not warm.compile_all()
    assert not is_cache_warm()
    assert "no such kernel" in caplog.text


def test_cancelling_ends_the_processes(small_groups, tmp_path):
    small_groups(slow=f"import os, time; open({str(tmp_path / 'pid')!r}, 'w').write(str(os.getpid())); time.sleep(60)")

    class Cancelled(Exception):
        pass

    def report(done: int, n: int, what: str) -> None:
        if (tmp_path / "pid").exists() and (tmp_path / "pid").read_text():
            raise Cancelled

    with pytest.raises(Cancelled):
        warm.compile_all(report)
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)
    assert is_free(use_kernel_cache() / warm.LOCK)
    assert not is_cache_warm()


def test_whoever_waits_for_another_program_compiles_nothing(small_groups):
    small_groups(never="raise SystemExit(1)")
    path = use_kernel_cache() / warm.LOCK
    path.parent.mkdir(parents=True)
    command = [sys.executable, "-c", HOLDER, str(path)]
    other = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    said = []

    def report(done: int, n: int, what: str) -> None:
        said.append(what)
        write_marker(use_kernel_cache())  # the other program is done
        other.kill()
        other.wait()

    assert other.stdout is not None
    assert other.stdout.readline() == "held\n"
    assert warm.compile_all(report)
    other.communicate()
    assert said == ["another program compiles"]


def test_the_lock_of_a_dead_program_is_not_waited_for(small_groups):
    small_groups(one="pass")
    lock = use_kernel_cache() / warm.LOCK
    lock.parent.mkdir(parents=True)
    lock.touch()
    said = []
    assert warm.compile_all(lambda done, n, what: said.append(what))
    assert "another program compiles" not in said


def test_where_no_lock_can_be_made_kernels_are_compiled_all_the_same(small_groups):
    small_groups(one="pass")
    (use_kernel_cache() / warm.LOCK).mkdir(parents=True)
    assert warm.compile_all()


def test_every_group_has_a_warm_up():
    from importlib import import_module

    for _, module, _ in warm.GROUPS:
        assert callable(import_module(module).warm_up)
