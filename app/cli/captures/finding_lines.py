"""Output of `clipgstream inspect` about the findings of the capture doctor, as lines and as JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from app.cli.captures.correction_arguments import correction_flags
from engine.doctor.doctor import Diagnosis
from engine.doctor.finding import Finding
from engine.text import printable

SIGNS = {"error": "!!", "warning": "! ", "note": "- "}


def finding_lines(findings: Sequence[Finding], *, path: str) -> list[str]:
    """Two or three lines per finding: the fault, its certainty, the remedy, and the flags for it."""
    lines = []
    for finding in findings:
        sign = SIGNS[finding.severity]
        lines.append(printable(f"{sign} {finding.severity}, {finding.certainty_word}: {finding.text}"))
        lines.append(printable(f"   {finding.advice}"))
        if finding.fix is not None:
            lines.append(printable(f"   clipgstream inspect {path} {correction_flags(finding.fix)}"))
    return lines


def diagnosis_lines(diagnosis: Diagnosis, names: Sequence[str], *, path: str) -> list[str]:
    """All findings, and how well the calibration fits."""
    lines = finding_lines(diagnosis.findings, path=path)
    bad = sum(finding.severity != "note" for finding in diagnosis.findings)
    head = f"Capture doctor: {bad or 'no'} problem{'' if bad == 1 else 's'} found"
    looked = f"{diagnosis.n_pictures} pictures checked in {diagnosis.seconds:.0f} s"
    known = [(px, name) for px, name in zip(diagnosis.camera_px, names, strict=True) if not math.isnan(px)]
    fits = ""
    if known:
        worst, name = max(known)
        middle = sorted(px for px, _ in known)[len(known) // 2]
        fits = (
            f"; calibration: cameras usually miss their neighbours' lines by {middle:.2f} px, {name} by {worst:.2f} px"
        )
    return [printable(f"{head} ({looked}{fits})."), *lines]


def diagnosis_document(diagnosis: Diagnosis, names: Sequence[str]) -> dict[str, Any]:
    """JSON-able: seconds, n_pictures, findings, cameras and pairs."""
    return {
        "seconds": round(diagnosis.seconds, 2),
        "n_pictures": diagnosis.n_pictures,
        "findings": [finding_document(finding) for finding in diagnosis.findings],
        "cameras": [
            {"name": name, "epipolar_px": _number(px), "n_features": int(n)}
            for name, px, n in zip(names, diagnosis.camera_px, diagnosis.n_features, strict=True)
        ],
        "pairs": [
            {
                "cameras": [names[pair.first], names[pair.second]],
                "n_matches": pair.n_matches,
                "epipolar_px": _number(pair.median_px),
            }
            for pair in diagnosis.pairs
        ],
    }


def finding_document(finding: Finding) -> dict[str, Any]:
    """JSON-able: kind, severity, cameras, frames, text, certainty, advice, flags (None where nothing helps)."""
    return {
        "kind": finding.kind,
        "severity": finding.severity,
        "cameras": list(finding.cameras),
        "frames": list(finding.frames),
        "text": finding.text,
        "certainty": round(finding.certainty, 3),
        "advice": finding.advice,
        "flags": None if finding.fix is None else correction_flags(finding.fix),
    }


def _number(px: float) -> float | None:
    return None if math.isnan(px) else round(float(px), 3)
