"""LPIPS: why there is none, and what the network gets."""

import sys
from types import ModuleType

import numpy as np
import pytest
import torch

from app.lab.added import lpips
from tests.engine.metrics.made_pictures import disturbed, scene


def pair(size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    truth = scene(*size)
    return disturbed(truth), truth


class FakeNetwork:
    """Stands in for lpips.LPIPS: the mean difference of what the network would see."""

    def __init__(self, *, net: str, version: str, verbose: bool) -> None:
        assert (net, version, verbose) == ("vgg", "0.1", False)

    def eval(self) -> "FakeNetwork":
        return self

    def __call__(self, a: torch.Tensor, b: torch.Tensor, *, normalize: bool) -> torch.Tensor:
        assert a.shape == b.shape == (1, 3, 60, 80)
        return (a - b).abs().mean().reshape(1, 1, 1, 1) * (2 if normalize else 1)


@pytest.fixture
def fake_lpips(monkeypatch: pytest.MonkeyPatch, tmp_path):
    """Both packages are there; weights in the folder that is given back, once a file is put there."""
    module = ModuleType("lpips")
    module.LPIPS = FakeNetwork  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "lpips", module)
    monkeypatch.setattr(lpips.importlib.util, "find_spec", lambda name: object())
    monkeypatch.setattr(torch.hub, "get_dir", lambda: str(tmp_path))
    lpips._network.cache_clear()
    yield tmp_path / "checkpoints"
    lpips._network.cache_clear()


def test_lpips_is_empty_with_a_reason_where_it_cannot_be_had(fake_lpips, monkeypatch):
    image, truth = pair((60, 80))
    assert lpips.lpips(image, truth) is None
    assert lpips.WEIGHTS_FILE in (lpips.why_missing() or "")
    monkeypatch.setattr(lpips.importlib.util, "find_spec", lambda name: None)
    assert lpips.why_missing() == "the package lpips is not installed"


def test_lpips_feeds_the_network_the_range_it_names(fake_lpips):
    fake_lpips.mkdir()
    (fake_lpips / lpips.WEIGHTS_FILE).touch()
    image, truth = pair((60, 80))
    expected = np.abs(image - truth).mean()
    assert lpips.lpips_unscaled(image, truth) == pytest.approx(expected, rel=1e-5)
    assert lpips.lpips(image, truth) == pytest.approx(2 * expected, rel=1e-5)
