"""Fixtures of the training tests: a tiny capture with a trained reference clip, made once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from tests.built_once import BuiltOnce
    from tests.engine.training.tiny_training import Tiny


@pytest.fixture(scope="session")
def tiny(tmp_path_factory: pytest.TempPathFactory, built_once: BuiltOnce) -> Tiny:
    """See tests.engine.training.tiny_training."""
    # imported here: this file is read before tests/conftest.py has said which threads numba takes
    from tests.engine.training.tiny_training import make_tiny

    return make_tiny(tmp_path_factory.mktemp("tiny_training"), built_once)
