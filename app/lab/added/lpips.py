"""LPIPS by the real `lpips` package and VGG weights, where both are on this machine. Nothing is ever downloaded."""

from __future__ import annotations

import functools
import importlib
import importlib.util
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

WEIGHTS_FILE = "vgg16-397923af.pth"
"""torchvision's ImageNet weights of VGG-16, under this name in torch's own folder of downloads."""

Network = Callable[..., object]


def why_missing() -> str | None:
    """Why there is no LPIPS on this machine, in words, or None if there is."""
    for package in ("lpips", "torchvision"):
        if importlib.util.find_spec(package) is None:
            return f"the package {package} is not installed"
    if not weights_path().is_file():
        return f"the weights {WEIGHTS_FILE} are not in {weights_path().parent}; nothing is downloaded"
    return None


def weights_path() -> Path:
    """Where torch looks for the weights before it would download them."""
    import torch

    return Path(torch.hub.get_dir()) / "checkpoints" / WEIGHTS_FILE


def lpips(image: np.ndarray, truth: np.ndarray) -> float | None:
    """LPIPS with VGG-16, version 0.1, pictures in 0..1 brought to the -1..1 that the network was made for.

    None where `why_missing` has a reason. Pictures [H, W, 3], clamped. Source: Zhang et al. 2018.
    """
    return _distance(image, truth, is_scaled=True)


def lpips_unscaled(image: np.ndarray, truth: np.ndarray) -> float | None:
    """The same with pictures in 0..1 fed as they are: not what the network expects, but what published tables of
    Gaussian splatting mostly show."""
    return _distance(image, truth, is_scaled=False)


def _distance(image: np.ndarray, truth: np.ndarray, *, is_scaled: bool) -> float | None:
    if why_missing() is not None:
        return None
    import torch

    def tensor(picture: np.ndarray) -> torch.Tensor:
        array = np.clip(picture, 0.0, 1.0).astype(np.float32).transpose(2, 0, 1)[None]
        return torch.from_numpy(np.ascontiguousarray(array))

    with torch.no_grad():
        found = _network()(tensor(image), tensor(truth), normalize=is_scaled)
    return float(found)  # type: ignore[arg-type]


@functools.cache
def _network() -> Network:
    module = importlib.import_module("lpips")
    with warnings.catch_warnings():  # lpips uses names of torchvision that are on their way out
        warnings.simplefilter("ignore")
        return module.LPIPS(net="vgg", version="0.1", verbose=False).eval()
