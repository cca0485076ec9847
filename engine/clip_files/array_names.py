"""Names of the arrays of a clip file, as far as they say what an array is. See also engine.clip_files.anchor_record."""

from __future__ import annotations

OWN, INHERITED, REASONS = "sets", "inherited", "gate"
"""How names of arrays of anchors begin, before a dot and a role: those that the clip itself stores; what it says of
those it inherits; why the gate decided about each."""
DECODER, MOVING_DECODER, FIELD, TABLES = "decoder.", "moving_decoder.", "field.", "field.tables."
"""How the names of the decoder's arrays begin, of those of the heads for moving parts where they are others, of the
field's, and of the field's tables."""
GAINS = "gains"
"""Of the training cameras, in a clip that inherits nothing."""
CORRECTIONS = "camera_corrections"
"""Of the training cameras, in a clip that inherits nothing; missing where they were not refined."""
VIGNETTING = "vignetting"
"""Of the training cameras' lenses, in a clip that inherits nothing; missing where none was found."""
LOG_DRIFT = "log_drift"
"""Log of the training cameras' exposure against the reference clip's, frame by frame; missing where none changes."""


def own_kind(name: str) -> str | None:
    """The part of the clip's anchors in an array, an attribute of StoredAnchors; None for any other array."""
    group, _, rest = name.partition(".")
    return rest.rpartition(".")[2] if group == OWN else None


def is_said_of_anchors(name: str) -> bool:
    """Whether an array says something of anchors, inherited ones too, that is not theirs."""
    return name.partition(".")[0] in (INHERITED, REASONS)


def table_index(name: str) -> int | None:
    """Which of the field's tables an array is; None for any other array."""
    return int(name.removeprefix(TABLES)) if name.startswith(TABLES) else None
