"""The checks that look at no pixels: done in a moment, also for a capture that is only being opened."""

from __future__ import annotations

from engine.capture.capture import Capture
from engine.doctor.checks.coverage import check_coverage, measure_coverage
from engine.doctor.checks.frame_counts import check_frame_counts
from engine.doctor.checks.holdout import check_holdout
from engine.doctor.checks.masks import check_masks
from engine.doctor.checks.sizes import check_sizes
from engine.doctor.checks.twins import check_twins
from engine.doctor.finding import Finding, in_order


def quick_findings(capture: Capture) -> list[Finding]:
    """The findings from a capture's numbers alone, the worst first."""
    return in_order([*check_numbers(capture), *check_holdout(capture.rig, capture.default_holdout)])


def check_numbers(capture: Capture) -> list[Finding]:
    """The same without advice on cameras to hold out, which depends on what else is found."""
    rig = capture.native_rig
    return [
        *check_frame_counts(capture),
        *check_sizes(capture),
        *check_twins(rig),
        *check_coverage(rig, measure_coverage(rig)),
        *check_masks(capture),
    ]
