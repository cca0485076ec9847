"""FLIP: what a viewer notices when two pictures alternate, 0 (nothing) to 1, by NVIDIA's own implementation."""

from __future__ import annotations

import importlib.util

import numpy as np

from engine.metrics.similarity import masked_mean


def why_missing() -> str | None:
    """Why there is no FLIP on this machine, in words, or None if there is."""
    if importlib.util.find_spec("flip_evaluator") is None:
        return "the package flip-evaluator is not installed; it has no wheel for every platform"
    return None


def flip_map(image: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """LDR-FLIP error of each pixel. [H, W] float32 in 0..1

    Args:
        image, truth: Display-encoded sRGB, clamped to 0..1 here. [H, W, 3]
    Raises:
        ValueError: A value is not finite; the library would call such pixels equal.

    Viewing distance is the library's default, 67 pixels per degree (a 0.7 m wide 3840 px screen at 0.7 m).
    Source: Andersson et al. 2020, package flip-evaluator.
    """
    import flip_evaluator

    test, reference = (np.ascontiguousarray(np.clip(p, 0.0, 1.0), dtype=np.float32) for p in (image, truth))
    if not (np.isfinite(test).all() and np.isfinite(reference).all()):
        raise ValueError("FLIP is not defined for pictures with values that are not finite")
    errors, _, _ = flip_evaluator.evaluate(
        reference, test, "LDR", inputsRGB=True, applyMagma=False, computeMeanError=False, parameters={}
    )
    return errors[..., 0]


def flip(image: np.ndarray, truth: np.ndarray, mask: np.ndarray | None = None) -> float:
    """Mean of `flip_map` over all pixels or those of a mask [H, W] bool; NaN for an empty one.

    The mean is taken here in float64, because the library's own depends on the number of threads.
    """
    return masked_mean(flip_map(image, truth), mask)
