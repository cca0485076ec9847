"""Bytes of a clip file by what they describe."""

from __future__ import annotations

from pathlib import Path

from engine.clip_files.clip_state import read_clip_metadata, reason_of
from engine.errors import ProjectError
from engine.storage.array_files import ArraysError

COMPONENTS = (
    ("positions", "sets.", ".positions"),
    ("features", "sets.", ".features"),
    ("scales", "sets.", "_scales"),
    ("colours", "sets.", ".color_logits"),
    ("presence", "", ".presence"),
    ("presence", "inherited.", ".is_hidden"),
    ("presence", "gate.", ""),
    ("field tables", "field.tables.", ""),
    ("field network", "field.", ""),
    ("decoder", "decoder.", ""),
    ("gains", "gains", ""),
)
"""Name of each component, and how the names of its arrays begin and end; the first that fits counts. Presence is of
inherited anchors too, and what the gate decided."""
OTHER = "other arrays"
HEADER = "header"
"""Names, shapes, settings and figures: everything that is not an array."""
COMPONENT_NAMES = (*dict.fromkeys(name for name, _, _ in COMPONENTS), OTHER, HEADER)


def component_of(array_name: str) -> str:
    """The component an array of a clip belongs to."""
    for component, start, end in COMPONENTS:
        if array_name.startswith(start) and array_name.endswith(end):
            return component
    return OTHER


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
