"""Shared fixtures: fixed seeds, few torch threads, a tiny capture with known truth, and the golden-picture switch."""

import os
import random
import sys
from pathlib import Path

import numpy as np
import pytest

SEED = 20_240
TORCH_THREADS = 2  # what the smallest machine has; more would make sums, and so results, depend on the machine


def pytest_configure() -> None:
    from engine.kernels.cache import use_kernel_cache

    use_kernel_cache()  # as the program's main functions do; before any test imports kernels
    os.environ.setdefault("NUMBA_THREADING_LAYER", "omp")  # the layer the program uses; set before numba is imported


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--update-golden",
        action="store_true",
        default=False,
        help="write the golden pictures anew instead of comparing with them; look at each before committing it",
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
    torch = sys.modules.get("torch")  # not imported here: tests that need no torch stay fast without it
    if torch is not None:
        torch.manual_seed(SEED)
        torch.set_num_threads(TORCH_THREADS)


@pytest.fixture
def rng() -> np.random.Generator:
    """A generator with a fixed seed, one per test."""
    return np.random.default_rng(SEED)


@pytest.fixture(scope="session")
def tiny_capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a small capture in the layout of the shipped sample, made once per session by our own generator.

    Eight cameras of 96x72, two clips of five frames; the second clip has the object that appears. Takes a few seconds.
    """
    pytest.importorskip("open3d", reason="the generator needs Open3D and its system libraries", exc_type=ImportError)
    from engine.synthetic import write_capture

    folder = tmp_path_factory.mktemp("tiny_capture")
    write_capture(folder, size=(96, 72), n_cameras=8, n_frames=10, clip_length=5, supersampling=2)
    return folder
