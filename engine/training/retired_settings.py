"""Settings that projects of earlier versions store and this one does not have: they are dropped when such a project is
read, so that it opens and trains as it does without them, and files kept with them are found again."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

RETIRED_SETTINGS: dict[str, Collection[object] | None] = {
    "backend": None,  # belongs to the machine: engine.backends.table
    "coarse_share": None,
    "decode_backend": None,
    "patience": None,
    "sampling": None,
    "gate": ("images",),
}
"""Name to the values that are gone; None where the whole setting is."""


def without_retired(values: Mapping[str, Any]) -> dict[str, Any]:
    """Stored settings that still exist, as far as this table knows."""
    return {name: value for name, value in values.items() if not _is_retired(name, value)}


def _is_retired(name: str, value: object) -> bool:
    if name not in RETIRED_SETTINGS:
        return False
    gone = RETIRED_SETTINGS[name]
    return gone is None or value in gone
