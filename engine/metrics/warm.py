"""Compile, or load from the cache, every kernel that measures pictures."""

from engine.metrics import flip, window


def warm_up() -> None:
    """Run each kernel once."""
    window.warm_up()
    flip.warm_up()
