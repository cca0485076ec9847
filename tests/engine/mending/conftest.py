"""The tiny capture of the training tests, here too."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from tests.built_once import BuiltOnce
    from tests.engine.training.tiny_training import Tiny


@pytest.fixture(scope="session")
def tiny(tmp_path_factory: pytest.TempPathFactory, built_once: BuiltOnce) -> Tiny:
    """See tests.engine.training.tiny_training."""
    from tests.engine.training.tiny_training import make_tiny

    return make_tiny(tmp_path_factory.mktemp("tiny_mending"), built_once)
