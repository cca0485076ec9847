"""Bytes of a clip file by what they describe."""

from __future__ import annotations

import math
from pathlib import Path

from safetensors import SafetensorError, safe_open

from engine.errors import ProjectError

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
"""Names, shapes, settings and figures: all that is no array."""
COMPONENT_NAMES = (*dict.fromkeys(name for name, _, _ in COMPONENTS), OTHER, HEADER)
_BYTES = {"F64": 8, "I64": 8, "U64": 8, "F32": 4, "I32": 4, "U32": 4, "F16": 2, "BF16": 2, "I16": 2, "U16": 2}


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
        with safe_open(path, framework="numpy") as file:
            for name in file.keys():  # noqa: SIM118 - not a mapping
                part = file.get_slice(name)
                found[component_of(name)] += math.prod(part.get_shape()) * _BYTES.get(part.get_dtype(), 1)
        found[HEADER] += path.stat().st_size - sum(found.values())
    except (OSError, SafetensorError) as error:
        raise ProjectError(
            f"The clip file is damaged or no clip file ({error}).", hint="Train the clip again.", path=path
        ) from error
    return found
