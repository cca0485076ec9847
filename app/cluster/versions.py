"""The versions that have to agree between computers: results depend on them, and messages on the program itself."""

from __future__ import annotations

import importlib.metadata
import platform
from functools import cache
from hashlib import blake2b
from pathlib import Path

LIBRARIES = ("numba", "numpy", "torch")


@cache
def versions() -> dict[str, str]:
    """Of this computer, by name."""
    found = {"ClipGStream": _sources(), "Python": platform.python_version()}
    return found | {name: importlib.metadata.version(name).partition("+")[0] for name in LIBRARIES}


def difference(there: dict[str, str]) -> str:
    """How another computer's versions differ from this one's, as the end of a sentence; empty where they do not."""
    here = versions()
    if there.get("ClipGStream") != here["ClipGStream"]:
        return "has another version of ClipGStream"
    other = [name for name in here if there.get(name) != here[name]]
    listed = ", ".join(f"{name} {there.get(name, 'missing')} (here {here[name]})" for name in other)
    return f"has {listed}" if other else ""


def _sources() -> str:
    """Hash of the program: a version number does not see what a developer changed."""
    root, digest = Path(__file__).parents[2], blake2b(digest_size=8)
    for package in ("app", "engine"):
        for path in sorted((root / package).rglob("*.py")):
            digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()
