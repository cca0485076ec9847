"""Checks of arguments that public calls with compiled kernels share. Cheap: they run at every step of a training."""

from __future__ import annotations

from numbers import Integral, Real

from torch import Tensor


def require_tensor(name: str, value: object) -> None:
    """TypeError that names the argument, unless it is a tensor that holds numbers (not one on device meta)."""
    if not isinstance(value, Tensor):
        raise TypeError(f"{name} must be a torch tensor, got {type(value).__module__}.{type(value).__qualname__}")
    if value.is_meta:
        raise TypeError(f"{name} must hold numbers, got a tensor on device meta")


def require_count(name: str, value: object) -> None:
    """TypeError that names the argument, unless it is a whole number."""
    if not isinstance(value, Integral):
        raise TypeError(f"{name} must be a whole number, got {value!r}")


def require_number(name: str, value: object) -> None:
    """TypeError that names the argument, unless it is a number."""
    if not isinstance(value, Real):
        raise TypeError(f"{name} must be a number, got {value!r}")
