"""Prisms and keyed volumes in documents: they come back as they were, and what was changed by hand is named."""

from __future__ import annotations

import copy
import json
import random
from typing import Any

import pytest

from app.document.changes import edit_changes as change
from app.document.storing.stored_document import document_of, plain_document
from engine.editing.actions import Delete
from engine.editing.edit import Box, KeyedVolume, Prism, Sphere, VolumeKey
from engine.errors import ProjectError
from engine.storage.typed_json import EntryError
from tests.app.document.documents import EMPTY

PRISM = Prism((0.1, 0.2, 0.3), (1.0, 2.0, 0.7), ((-1.0, -0.3), (1.0, -1.0), (0.1, 1.0)), (0.6, 0.0, 0.8, 0.0), 3.3)
BALLS = KeyedVolume((VolumeKey(2.5, Sphere((0.1, 0.0, 0.0), 1.0)), VolumeKey(9.0, Sphere((3.0, 0.0, 1e-7), 0.3))))
FULL = EMPTY
for target in (PRISM, BALLS, KeyedVolume((VolumeKey(0.0, PRISM),)), Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))):
    FULL = change.add_edit(FULL, Delete(), target)


def test_they_come_back_to_the_last_digit() -> None:
    assert document_of(json.loads(json.dumps(plain_document(FULL)))) == FULL


def test_any_damage_is_refused_by_name_or_leaves_a_document_that_can_be_kept() -> None:
    rng, n_refused = random.Random(0), 0
    for _ in range(300):
        plain: Any = copy.deepcopy(json.loads(json.dumps(plain_document(FULL))))
        _damage(plain["edits"][rng.randrange(3)]["target"], rng)
        try:
            found = document_of(plain)
        except (EntryError, ProjectError):
            n_refused += 1
        else:
            assert document_of(plain_document(found)) == found
    assert n_refused > 100


def _damage(part: Any, rng: random.Random) -> None:
    """Change one thing somewhere within lists and objects."""
    while True:
        place: Any = rng.choice(list(part) if isinstance(part, dict) else range(len(part)))
        inner = part[place]
        if isinstance(inner, dict | list) and inner and rng.random() < 0.8:
            part = inner
            continue
        kinds = (None, -1, 0, 1e300, -3.5, True, "box", "\ud7ff", [], {}, [[0, 0]], {"frame": 1})
        change = rng.choice((*kinds, "gone", "twice", "extra"))
        if change == "gone":
            del part[place]
        elif change == "twice" and isinstance(part, list):
            part.insert(place, inner)
        elif change == "extra" and isinstance(part, dict):
            part["extra"] = 1
        else:
            part[place] = change
        return


def test_keys_that_cannot_be_are_refused_when_they_are_made() -> None:
    twins = {"type": "keyed", "keys": [{"frame": 1, "volume": _plain_ball(1.0)}] * 2}
    plain = plain_document(FULL)
    with pytest.raises(EntryError, match="not in order or too close"):
        document_of({**plain, "edits": [{**plain["edits"][0], "target": twins}]})


def _plain_ball(radius: float) -> dict[str, Any]:
    return {"type": "sphere", "center": [0, 0, 0], "radius": radius}
