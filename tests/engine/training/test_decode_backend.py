"""decode_backend: the same step with the anchors decoded in plain torch."""

from __future__ import annotations

import numpy as np
import pytest

from engine.errors import ProjectError
from engine.model.decode import decoding
from engine.training.config import TrainConfig

SETTINGS = {"gate": "off", "tiles": "all"}


@pytest.fixture
def calls(monkeypatch):
    """Names of the back ends that decode, in order."""
    seen = []

    def noted(name, decode):
        def run(*arguments):
            seen.append(name)
            return decode(*arguments)

        return run

    monkeypatch.setattr(decoding, "_BACKENDS", {n: noted(n, decode) for n, decode in decoding._BACKENDS.items()})
    return seen


@pytest.mark.slow
@pytest.mark.parametrize("settings", [{}, SETTINGS])
def test_plain_torch_learns_the_same_but_for_rounding(tiny, calls, settings):
    losses, arrays = {}, {}
    for backend in ("auto", "reference"):
        training = tiny.prepared(1, decode_backend=backend, **settings)
        calls.clear()
        losses[backend] = [training.step().loss for _ in range(4)]
        assert set(calls) == {"cpu" if backend == "auto" else "reference"}
        arrays[backend] = training.state().arrays
    assert losses["reference"] == pytest.approx(losses["auto"], rel=1e-4)
    assert arrays["auto"].keys() == arrays["reference"].keys()
    for name, array in arrays["auto"].items():
        # first steps of Adam have the size of the rate, whatever that of the gradient: where one is zero but for
        # rounding, a parameter may go the other way
        is_other = np.abs(array.astype(float) - arrays["reference"][name]) > 1e-3
        assert is_other.mean() < 0.01, name


def test_only_known_back_ends():
    with pytest.raises(ProjectError, match="decode_backend is 'cuda'; it has to be 'auto' or 'reference'"):
        TrainConfig(decode_backend="cuda")
