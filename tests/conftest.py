"""Shared fixtures: fixed seeds, few torch threads, a tiny capture with known truth, and the golden-picture switch."""

import os
import random
import sys
from collections import Counter
from collections.abc import Generator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import settings

from tests.built_once import BuiltOnce

SEED = 20_240
TORCH_THREADS = 2  # what the smallest machine has; more would make sums, and so results, depend on the machine


settings.register_profile("studio", deadline=None)  # a busy machine is not a fault
settings.load_profile("studio")


def pytest_configure(config: pytest.Config) -> None:
    from engine.kernels.cache import use_kernel_cache

    use_kernel_cache()  # as the program's main functions do; before any test imports kernels
    os.environ.setdefault("NUMBA_THREADING_LAYER", "omp")  # the layer the program uses; set before numba is imported
    if config.getoption("numprocesses", None):  # the process that starts workers, which would all compile the same
        from engine.kernels.compile_ahead import compile_all

        compile_all()
        os.environ.setdefault("GOMP_SPINCOUNT", "0")  # a thread that waits leaves its core to the other worker


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """In a worker, files with the most slow tests come first: one that comes last leaves the other workers waiting."""
    if hasattr(config, "workerinput"):
        n_slow = Counter(item.path for item in items if item.get_closest_marker("slow"))
        items.sort(key=lambda item: -n_slow[item.path])


@pytest.hookimpl(wrapper=True)
def pytest_report_to_serializable() -> Generator[None, Any, Any]:
    """A worker can send Unicode only, and tests log names of files that are none."""
    return _as_unicode((yield))


def _as_unicode(value: Any) -> Any:
    match value:
        case str():
            return value.encode("utf-8", "backslashreplace").decode()
        case dict():
            return {key: _as_unicode(entry) for key, entry in value.items()}
        case list() | tuple():
            return type(value)(_as_unicode(entry) for entry in value)
    return value


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--update-golden",
        action="store_true",
        default=False,
        help="write the golden pictures anew instead of comparing with them; look at each before committing it",
    )
    parser.addoption(
        "--no-fixture-cache",
        action="store_true",
        default=False,
        help="train the clips that tests look at anew instead of taking those of an earlier run",
    )


@pytest.fixture
def update_golden(request: pytest.FixtureRequest) -> bool:
    """Whether golden pictures are to be written instead of compared."""
    return bool(request.config.getoption("--update-golden"))


@pytest.fixture(autouse=True)
def _fixed_seeds() -> None:
    """Every test starts from the same state of every random generator, whichever tests ran before it."""
    random.seed(SEED)
    np.random.seed(SEED)  # noqa: NPY002 - libraries we call may still draw from the global generator
    if "torch" in sys.modules:  # not imported otherwise: tests that need no torch stay fast without it
        import torch  # waits for a thread that an earlier test has left importing it; half loaded, both would fail

        torch.manual_seed(SEED)
        torch.set_num_threads(TORCH_THREADS)


@pytest.fixture
def rng() -> np.random.Generator:
    """A generator with a fixed seed, one per test."""
    return np.random.default_rng(SEED)


@pytest.fixture(scope="session")
def built_once(request: pytest.FixtureRequest) -> BuiltOnce:
    """Keeps what takes seconds to build; see tests.built_once."""
    cache = getattr(request.config, "cache", None)  # pytest can be told to do without
    if cache is None or request.config.getoption("--no-fixture-cache"):
        return BuiltOnce(None)
    return BuiltOnce(cache.mkdir("built-once"))


@pytest.fixture(scope="session")
def tiny_capture(tmp_path_factory: pytest.TempPathFactory, built_once: BuiltOnce) -> Path:
    """Folder of a small capture in the layout of the shipped sample, made by our own generator.

    Eight cameras of 96x72, two clips of five frames; the second clip has the object that appears. Takes a few seconds.
    """
    pytest.importorskip("open3d", reason="the generator needs Open3D and its system libraries", exc_type=ImportError)
    from app.lab.synthetic import write_capture

    def build(folder: Path) -> None:
        write_capture(folder, size=(96, 72), n_cameras=8, n_frames=10, clip_length=5, supersampling=2)

    return built_once.copy(
        "tiny_capture", tmp_path_factory.mktemp("tiny_capture"), build, sources=["tests/conftest.py"]
    )
