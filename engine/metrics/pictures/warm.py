"""Compile, or load from the cache, every kernel that measures pictures."""

from engine.metrics.pictures import flip
from engine.metrics.pictures import ssim_window as window


def warm_up() -> None:
    """Run each kernel once."""
    window.warm_up()
    flip.warm_up()
