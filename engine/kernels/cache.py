"""Where compiled kernels lie: one folder of the user's cache per version of our sources, libraries and processor.

numba looks at a kernel's own file only; a change in a helper that it imports leaves stale machine code behind. So the
folder's name is a hash of every source that ends up in a kernel, of the versions of numba, llvmlite and Python, and of
the processor. Machine code itself is still checked by numba against the exact processor, so a folder can never hold
code that does not run. A completed warm-up leaves a marker that says what was compiled
(`engine.kernels.compile_ahead`).

Who owns a process calls `use_kernel_cache` once, before any decorator of a kernel runs: the command line, the window
and the worker do so first of all. Importing `engine` changes nothing, so kernels of other programs stay where those
want them. The call imports neither numba nor torch, takes some 25 ms for the hash, and never fails. NUMBA_CACHE_DIR
wins when the user has set it.
"""

from __future__ import annotations

import os
import re
import stat
import sys
from collections.abc import Iterable
from contextlib import suppress
from functools import cache
from hashlib import blake2b
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from engine.kernels.fast_math import CPU_VARIABLE
from engine.machine import processor_text
from engine.user_folders import NAME, cache_dir

VARIABLE = "NUMBA_CACHE_DIR"
MARKER = "warm.json"
MAX_FOLDERS = 3
"""Folders of other versions beyond the newest three are removed after a warm-up."""

UNWRITABLE = "folder not writable"
"""Reason of `CacheState` that only the user can mend."""

_PREFIX = "kernels-"
_PACKAGE = Path(__file__).resolve().parents[1]
_DECORATORS = tuple(
    f"@{name}".encode()
    for name in ("njit", "jit", "numba.", "vectorize", "guvectorize", "intrinsic", "kernel_intrinsic", "routine(")
)
_WHOLE_FOLDERS = ("kernels/", "cpu/")
"""Folders that hold nothing but kernels and what calls them: all their files count."""
_WARM_UP = "warm.py"
"""Files of this name say which kernels are compiled, and for which types."""
_FROM = re.compile(rb"from (?:clipgstream\.)?(engine[\w.]*) import (\([^)]*\)|[^\n#]*)")
_RENAMED = re.compile(rb"\s+as\s+\w+")
_CODE_VARIABLES = (
    CPU_VARIABLE,
    "NUMBA_BOUNDSCHECK",
    "NUMBA_CPU_FEATURES",
    "NUMBA_CPU_NAME",
    "NUMBA_DISABLE_INTEL_SVML",
    "NUMBA_ENABLE_AVX",
    "NUMBA_LOOP_VECTORIZE",
    "NUMBA_OPT",
    "NUMBA_SLP_VECTORIZE",
)
"""Settings of numba that change machine code without numba's cache noticing."""


class CacheKey(NamedTuple):  # a dataclass would double the time that importing this module takes
    """The inputs that compiled kernels depend on; each part is a short hash or text, so that a difference can be named.

    Attributes:
        sources: Hash of all sources that end up in kernels.
        libraries: numba, llvmlite and Python, and settings of numba that change code.
        processor: Model and instruction sets.
    """

    sources: str
    libraries: str
    processor: str

    @property
    def folder_name(self) -> str:
        """Name of the folder of this key."""
        return f"{_PREFIX}{_hash([part.encode() for part in (self.sources, self.libraries, self.processor)])}"


class CacheState(NamedTuple):
    """The content of the cache.

    Attributes:
        folder: Where kernels are kept; need not exist.
        is_warm: Whether everything was compiled for exactly these sources, libraries and processor.
        reason: Why it is not warm, or where it lies unusually; empty when there is nothing to say.
        is_fallback: Whether it is a temporary folder, because the user's cache cannot be written.
        n_bytes: Bytes in the folder.
    """

    folder: Path
    is_warm: bool
    reason: str
    is_fallback: bool
    n_bytes: int


def fallback_root() -> Path:
    """Where kernels go when the user's cache cannot be written: a temporary folder of this user alone. Made here.

    Machine code is loaded from it, so a folder that anybody else could have filled is not taken.
    """
    import tempfile

    user = str(os.getuid()) if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    folder = Path(tempfile.gettempdir()) / f"{NAME}-{user}"
    with suppress(OSError):
        folder.mkdir(mode=0o700)
    return folder if _is_private(folder) else Path(tempfile.mkdtemp(prefix=f"{NAME}-"))


def kernel_folder() -> Path:
    """Where compiled kernels of these sources, libraries and this processor belong; need not exist.

    A folder of our own that came from a parent process is worked out again, so that sources changed in between are
    noticed. Creates nothing on disk, except for the folder of the fall-back.
    """
    given = os.environ.get(VARIABLE)
    if given and not _is_ours(Path(given)):
        return Path(given)
    return _chosen_root()[0] / current_key().folder_name


def use_kernel_cache() -> Path:
    """Tell numba where to keep compiled kernels, in this process and those it starts. Returns the folder.

    Must run before the module of a kernel is imported. For the main function of a process: a library that is imported
    leaves the environment alone.
    """
    folder = kernel_folder()
    os.environ[VARIABLE] = str(folder)
    config = sys.modules.get("numba.core.config")
    if config is not None:  # numba has read its environment already
        config.CACHE_DIR = str(folder)  # pyright: ignore[reportAttributeAccessIssue] - made at run time
    return folder


@cache
def current_key() -> CacheKey:
    """The key of this process: sources as they are on disk, libraries as installed, processor as it is."""
    return CacheKey(
        sources=sources_hash(_PACKAGE),
        libraries=_hash(_library_texts()),
        processor=_hash([processor_text().encode()]),
    )


def kernel_sources(package: Path) -> dict[str, bytes]:
    """Sources of the engine that hold, call or warm up kernels, and everything of the engine that kernels import.

    Args:
        package: The folder `engine`.
    Returns:
        Contents by path below `package`, in the order of the paths.
    """
    texts = _python_texts(str(package))
    found: set[str] = set()
    waiting = [path for path, text in texts.items() if any(name in text for name in _DECORATORS)]
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting += _imported(texts[path], texts)
    found.update(path for path in texts if _counts_by_place(path))
    return {path: texts[path] for path in sorted(found)}


def sources_hash(package: Path) -> str:
    """Hash of names and contents of `kernel_sources`."""
    parts: list[bytes] = []
    for path, text in kernel_sources(package).items():
        parts += [path.encode(), text]
    return _hash(parts)


def cache_state() -> CacheState:
    """Look at the cache: where, how large, warm or why not. Reads, never writes."""
    folder = kernel_folder()
    key, marked = current_key(), read_marker(folder)
    root, is_fallback = _chosen_root()
    is_fallback = is_fallback and folder.parent == root
    is_warm = marked == key
    if not _is_writable(folder):
        reason = UNWRITABLE
    elif is_warm:
        reason = ""
    else:
        others = [marked, *(read_marker(other) for other in keyed_folders(folder.parent) if other != folder)]
        reason = _difference(key, [other for other in others if other is not None])
    n_bytes = 0
    with suppress(OSError):
        n_bytes = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
    return CacheState(folder, is_warm, reason, is_fallback, n_bytes)


def is_cache_warm() -> bool:
    """Whether a warm-up was completed for exactly these sources, libraries and this processor."""
    return read_marker(kernel_folder()) == current_key()


def read_marker(folder: Path, name: str = MARKER) -> CacheKey | None:
    """The key of the last completed warm-up in this folder; None when there was none or it cannot be read."""
    from engine.storage.json_files import read_json_object

    try:
        values = read_json_object(folder / name, max_bytes=1 << 20)
        return CacheKey(**{name: str(values[name]) for name in CacheKey._fields})
    except (OSError, ValueError, KeyError, TypeError):
        return None


def write_marker(folder: Path, name: str = MARKER) -> None:
    """Say that everything is compiled, and remove the oldest folders of other keys. A failure to do so is ignored."""
    import json

    key = current_key()
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        new = folder / f"{name}.{os.getpid()}"
        new.write_text(json.dumps(key._asdict()) + "\n", "utf-8")
        new.replace(folder / name)
    if _is_ours(folder):
        prune(folder.parent, keep=folder)


def keyed_folders(root: Path) -> list[Path]:
    """Folders of kernels below a root, newest first."""
    with suppress(OSError):
        return sorted((path for path in root.iterdir() if path.name.startswith(_PREFIX) and path.is_dir()), key=_age_s)
    return []


def prune(root: Path, *, keep: Path) -> None:
    """Remove all but the newest folders of kernels; `keep` stays whatever its age. A failure is ignored."""
    import shutil

    others = [path for path in keyed_folders(root) if path != keep]
    for path in others[MAX_FOLDERS - 1 :]:
        shutil.rmtree(path, ignore_errors=True)


def _age_s(folder: Path) -> float:
    """Larger is older: by the marker, which every completed warm-up renews, else by the folder."""
    for path in (folder / MARKER, folder):
        with suppress(OSError):
            return -path.stat().st_mtime
    return 0.0


def _difference(key: CacheKey, others: Iterable[CacheKey]) -> str:
    """Why there is nothing for `key`, judged by what there is for the most similar other key."""
    reasons: dict[tuple[str, ...], str] = {
        ("sources",): "sources changed",
        ("processor",): "other CPU",
        ("libraries",): "other versions of numba, llvmlite or Python",
    }
    differences = [tuple(n for n in CacheKey._fields if getattr(key, n) != getattr(other, n)) for other in others]
    if not differences:
        return "never compiled"
    nearest = min(differences, key=len)
    return reasons.get(nearest, "sources and libraries changed")


def _python_texts(package: str) -> dict[str, bytes]:
    """All Python sources of a package: contents by path below it, with forward slashes."""
    texts: dict[str, bytes] = {}
    folders = [""]
    while folders:
        folder = folders.pop()
        with os.scandir(os.path.join(package, folder)) as entries:
            for entry in entries:
                if entry.name.endswith(".py"):
                    with open(entry.path, "rb", buffering=0) as file:
                        texts[folder + entry.name] = file.read()
                elif entry.name != "__pycache__" and entry.is_dir():
                    folders.append(f"{folder}{entry.name}/")
    return texts


def _counts_by_place(path: str) -> bool:
    """Whether a source counts wherever it is imported: it may call kernels with other types than before."""
    return path.endswith(f"/{_WARM_UP}") or any(f"/{folder}" in f"/{path}" for folder in _WHOLE_FOLDERS)


def _imported(text: bytes, texts: dict[str, bytes]) -> list[str]:
    """Files that a source imports from the engine, wherever in it the import stands.

    A name imported from a package is its submodule of that name, else something of the package's own file.
    """
    found: list[str] = []
    for match in _FROM.finditer(text):
        module = "/".join(match[1].decode().split(".")[1:])
        if f"{module}.py" in texts:
            found.append(f"{module}.py")
            continue
        folder = f"{module}/" if module else ""
        for name in re.findall(r"\w+", _RENAMED.sub(b"", match[2]).decode()):
            chosen = (f"{folder}{name}.py", f"{folder}{name}/__init__.py", f"{folder}__init__.py")
            found += [path for path in chosen if path in texts][:1]
    return found


def _library_texts() -> list[bytes]:
    """Versions without importing anything: the version files of the packages."""
    texts = [sys.version.encode()]
    for name in ("numba", "llvmlite"):
        spec = find_spec(name)
        if spec is not None and spec.origin is not None:
            with suppress(OSError):
                texts.append((Path(spec.origin).parent / "_version.py").read_bytes())
    texts += [f"{name}={os.environ[name]}".encode() for name in _CODE_VARIABLES if name in os.environ]
    return texts


def _chosen_root() -> tuple[Path, bool]:
    """Root of the keyed folders, and whether it is the fall-back."""
    root = cache_dir()
    if _is_writable(root):
        return root, False
    given = Path(os.environ.get(VARIABLE, ""))
    if _is_ours(given) and _is_private(given.parent):  # the fall-back of the parent process
        return given.parent, True
    return fallback_root(), True


def _is_ours(folder: Path) -> bool:
    return folder.name.startswith(_PREFIX) and folder.parent.name.startswith(NAME)


def _is_private(folder: Path) -> bool:
    """Whether a folder is there that belongs to this user and that nobody else may write to."""
    try:
        found = folder.lstat()
    except OSError:
        return False
    is_mine = not hasattr(os, "getuid") or (found.st_uid == os.getuid() and not found.st_mode & 0o022)
    return stat.S_ISDIR(found.st_mode) and is_mine


def _is_writable(folder: Path) -> bool:
    """Whether files can be made there, or in the nearest parent that exists."""
    try:
        for place in (folder, *folder.parents):
            if place.is_dir():
                return os.access(place, os.W_OK | os.X_OK)
            if place.exists():
                return False
    except OSError:
        return False
    return False


def _hash(parts: Iterable[bytes]) -> str:
    digest = blake2b(digest_size=8)
    for part in parts:
        digest.update(len(part).to_bytes(8, "little"))
        digest.update(part)
    return digest.hexdigest()
