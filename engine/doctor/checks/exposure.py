"""Exposure and white balance that drift. Training removes it from the pictures, so that little of it does no harm."""

from __future__ import annotations

import numpy as np

from engine.capture.writers.capture_json import Corrections
from engine.cloud.background.exposure_survey import CHANGE_LIMIT, ExposureCurve, ExposureSurvey
from engine.doctor.finding import Finding, PictureEvidence

LARGE = 0.2
"""A change of brightness by more than this share loses what is cut off at black or white."""
LARGE_COLOR = 0.1
"""Likewise for the ratio of two channels."""


def check_exposure(survey: ExposureSurvey) -> list[Finding]:
    """Cameras that change much one by one, the others in one sentence."""
    changing = {name: curve for name, curve in survey.curves.items() if curve.has_changed}
    large = {name: curve for name, curve in changing.items() if _is_large(curve)}
    found = [_large(name, curve) for name, curve in large.items()]
    small = [name for name in changing if name not in large]
    if small:
        most = max(float(np.ptp(changing[name].levels)) for name in small)
        found.append(
            Finding(
                kind="exposure",
                severity="note",
                cameras=tuple(small),
                frames=(),
                text=f"The exposure of {len(small)} of {survey.n_cameras} cameras changes by more than "
                f"{100 * CHANGE_LIMIT:g} %, at most by {100 * most:.1f} %.",
                certainty=0.9,
                advice="No action needed: training measures and removes it in every frame. Lock the exposure next "
                "time.",
            )
        )
    return found


def _is_large(curve: ExposureCurve) -> bool:
    return float(np.ptp(curve.levels)) > LARGE or curve.color_shift > LARGE_COLOR


def _large(name: str, curve: ExposureCurve) -> Finding:
    low, high = int(curve.levels.argmin()), int(curve.levels.argmax())
    color = f", its white balance by {100 * curve.color_shift:.0f} %" if curve.color_shift > CHANGE_LIMIT else ""
    step = "".join(f"; suddenly between frames {before} and {after}" for before, after, _ in curve.steps[:1])
    first, last = sorted((curve.frames[low], curve.frames[high]))
    return Finding(
        kind="exposure",
        severity="warning",
        cameras=(name,),
        frames=(first, last),
        text=f"The exposure of {name} changes by {100 * float(np.ptp(curve.levels)):.0f} %{color}{step}.",
        certainty=0.85,
        advice="Training removes what it can; clipped blacks and whites stay lost. Lock exposure and white "
        "balance next time, or leave this camera out.",
        fix=Corrections(is_excluded={name: True}),
        evidence=(PictureEvidence(name, first, f"{name}, frame {first}"), PictureEvidence(name, last, f"frame {last}")),
    )
