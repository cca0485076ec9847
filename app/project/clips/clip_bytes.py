"""Bytes of a clip file by what they describe."""

from __future__ import annotations

from pathlib import Path

from engine.clip_files.array_names import DECODER, FIELD, GAINS, MOVING_DECODER, TABLES, is_said_of_anchors, own_kind
from engine.clip_files.clip_state import read_clip_metadata, reason_of
from engine.errors import ProjectError
from engine.storage.array_files import ArraysError

_OWN_COMPONENTS = {
    "positions": "positions",
    "features": "features",
    "log_offset_scales": "scales",
    "log_base_scales": "scales",
    "color_logits": "colours",
    "presence": "presence",
}
"""Arrays of anchors to the name of the component."""
_PREFIXES = {
    TABLES: "field tables",
    FIELD: "field network",
    DECODER: "decoder",
    MOVING_DECODER: "decoder",
    GAINS: "gains",
}
"""How the names of other arrays begin; the first that fits counts."""
OTHER = "other arrays"
HEADER = "header"
"""Names, shapes, settings and figures: everything that is not an array."""
COMPONENT_NAMES = (*dict.fromkeys(_OWN_COMPONENTS.values()), *_PREFIXES.values(), OTHER, HEADER)


def component_of(array_name: str) -> str:
    """The component an array of a clip belongs to. Presence is of inherited anchors too, and what the gate decided."""
    kind = own_kind(array_name)
    if kind is not None:
        return _OWN_COMPONENTS.get(kind, OTHER)
    if is_said_of_anchors(array_name):
        return "presence"
    return next((name for prefix, name in _PREFIXES.items() if array_name.startswith(prefix)), OTHER)


def storage_of(path: Path) -> dict[str, int]:
    """Bytes per name of COMPONENT_NAMES; they add up to the size of the file. Reads no array.

    Raises:
        ProjectError: The file is missing or damaged.
    """
    found = dict.fromkeys(COMPONENT_NAMES, 0)
    try:
        for name, n_bytes in read_clip_metadata(path)[1].items():
            found[component_of(name)] += n_bytes
        found[HEADER] += path.stat().st_size - sum(found.values())
    except (OSError, ArraysError) as error:
        raise ProjectError(
            f"The clip file is damaged or not a clip file ({reason_of(error)}).",
            hint="Train the clip again.",
            path=path,
        ) from error
    return found
