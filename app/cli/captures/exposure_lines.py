"""Output of `clipgstream inspect` about the cameras' exposure over a capture, as lines and as JSON."""

from __future__ import annotations

from typing import Any

import numpy as np

from engine.cloud.background.exposure_survey import (
    CHANGE_LIMIT,
    MAX_SECONDS,
    STEP_LIMIT,
    ExposureCurve,
    ExposureSurvey,
)

HEIGHTS = "_.-'"
"""Signs of a curve from low to high, which every terminal has."""


def exposure_lines(survey: ExposureSurvey) -> list[str]:
    """One line per camera that changes, one for the others, and the correction in training."""
    frames = survey.frames
    lines = [f"Note: camera {name} could not be checked: {reason}" for name, reason in survey.unreadable.items()]
    if len(frames) < 2 or not survey.curves:
        return lines
    changing = {name: curve for name, curve in survey.curves.items() if curve.has_changed}
    n_calm = len(survey.curves) - len(changing)
    limit = f"{100 * CHANGE_LIMIT:g} %"
    looked = f"checked {len(frames)} of the frames from {frames[0]} to {frames[-1]}{_left_out(survey)}"
    if not changing:
        return [*lines, f"Exposure: no camera changes by more than {limit} ({looked})."]
    lines.append(f"Exposure, lowest to highest against frame {frames[0]}, and its curve over time ({looked}):")
    lines += [f"  {name:>8}  {_curve_text(curve)}" for name, curve in changing.items()]
    if n_calm:
        lines.append(f"  {n_calm} other {'camera' if n_calm == 1 else 'cameras'}: no change by more than {limit}.")
    lines.append("Training measures this again in every frame and removes it from the pictures, unless color is off.")
    return lines


def exposure_document(survey: ExposureSurvey) -> dict[str, Any]:
    """JSON-able: frames, limit, step_limit, n_measured, is_complete, unreadable, and per camera its curve."""
    return {
        "frames": list(survey.frames),
        "limit": CHANGE_LIMIT,
        "step_limit": STEP_LIMIT,
        "n_measured": len(survey.curves),
        "is_complete": survey.n_left_out == 0 and not survey.unreadable,
        "unreadable": survey.unreadable,
        "cameras": [
            {
                "name": name,
                "gains": [[round(float(gain), 5) for gain in row] for row in curve.gains],
                "lowest": round(float(curve.levels.min()), 5),
                "highest": round(float(curve.levels.max()), 5),
                "color_shift": round(curve.color_shift, 5),
                "has_changed": curve.has_changed,
                "steps": [
                    {"before": before, "after": after, "change": round(change, 5)}
                    for before, after, change in curve.steps
                ],
            }
            for name, curve in survey.curves.items()
        ],
    }


def curve_signs(levels: np.ndarray) -> str:
    """A curve in plain characters, one per value, from its lowest to its highest; flat where nothing changes."""
    span = float(np.ptp(levels))
    share = (levels - levels.min()) / span if span > 0 else np.zeros(len(levels))
    return "".join(HEIGHTS[min(int(value * len(HEIGHTS)), len(HEIGHTS) - 1)] for value in share)


def _curve_text(curve: ExposureCurve) -> str:
    low, high = (_percent(value) for value in (curve.levels.min(), curve.levels.max()))
    words = [f"{curve_signs(curve.levels)}  {low:>5} to {high:>5} %"]
    words += [
        f"step of {_percent(change)} % between frames {before} and {after} (auto exposure)"
        for before, after, change in curve.steps
    ]
    if curve.color_shift > CHANGE_LIMIT:
        words.append(f"white balance by {100 * curve.color_shift:.1f} %")
    return ", ".join(words)


def _percent(share: float) -> str:
    return f"{100 * share + 0.0:+.1f}"


def _left_out(survey: ExposureSurvey) -> str:
    n_looked_at = len(survey.curves)
    if not survey.n_left_out:
        return ""
    why = f"more would take longer than {MAX_SECONDS:g} s" if survey.is_late else "there are too many"
    return f", of {n_looked_at} of {survey.n_cameras} cameras: {why}"
