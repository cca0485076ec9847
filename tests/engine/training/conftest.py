"""Fixtures of the training tests: a tiny capture with a trained reference clip, made once; depth maps, found once."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from tests.built_once import BuiltOnce
    from tests.engine.training.tiny_training import Tiny

DEPTH_MAPS: dict[bytes, object] = {}
"""See tests.engine.depth_maps_once."""


@pytest.fixture(autouse=True, scope="module")
def depth_maps_once() -> Iterator[None]:
    """Depth maps of the same pictures are found once: most of what preparing a reference clip takes."""
    from tests.engine.depth_maps_once import remember_depth_maps

    with pytest.MonkeyPatch.context() as patch:
        remember_depth_maps(patch, DEPTH_MAPS)
        yield


@pytest.fixture(scope="module")
def small_backdrop() -> Iterator[None]:
    """A twentieth of the points behind everything: enough where brute force draws them."""
    from engine.cloud.stereo import unseen

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(unseen, "N_BACKDROP", unseen.N_BACKDROP // 20)
        yield


@pytest.fixture(scope="session")
def tiny(tmp_path_factory: pytest.TempPathFactory, built_once: BuiltOnce) -> Tiny:
    """See tests.engine.training.tiny_training."""
    # imported here: this file is read before tests/conftest.py has said which threads numba takes
    from tests.engine.training.tiny_training import make_tiny

    return make_tiny(tmp_path_factory.mktemp("tiny_training"), built_once)
