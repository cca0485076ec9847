"""The stages of a preparation in their order, so that a user can see how many are left."""

from __future__ import annotations

REFERENCE_STAGES = (
    "Reading pictures",
    "Measuring exposure",
    "Looking for what stands still",
    "Building the static cloud",
)
SOURCE_STAGES = (
    "Reading pictures",
    "Taking over the reference",
    "Measuring exposure",
    "Measuring light",
    "Finding what moves",
    "Carving what moves",
    "Comparing with the reference",
    "Sizing the field",
)


def stage_number(stage: str, *, is_reference: bool) -> tuple[int, int]:
    """Which stage this is and how many there are before the first step, from 1.

    Returns:
        Zeros for a stage that is not always there, such as compiling at the first start.
    """
    stages = REFERENCE_STAGES if is_reference else SOURCE_STAGES
    return (stages.index(stage) + 1, len(stages)) if stage in stages else (0, 0)
