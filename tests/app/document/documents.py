"""Documents that are edited at random, as somebody edits them who clicks everywhere."""

from __future__ import annotations

import json
import random
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from msgspec import structs

from app.document.history import Changed, DocumentHistory, Event, ObjectFound, Redone, Undone
from app.document.project_document import Label, Marker, ProjectDocument, World
from app.document.project_settings import ProjectSettings
from app.document.storing.stored_document import plain_document
from engine.camera.path_presets import turntable
from engine.capture.exclusions import Exclusions, PaintedMask, Stroke
from engine.editing.actions import Delete, Expose, Hide, Recolor, Transform
from engine.editing.copies.object_copy import ObjectCopy, OnObject, OnPath
from engine.editing.edit import Box, Edit, Fill, KeyedVolume, Picked, PickedRows, Prism, Scope, Sphere, VolumeKey
from engine.editing.fills.fill import FillGaussians, fill_key, packed_fill
from engine.editing.picks import pack_rows
from engine.editing.scene_object import ObjectInClip, ObjectSeed, SceneObject
from engine.gate.regions import sphere_region
from engine.timing.segment import Segment

SETTINGS = ProjectSettings(capture="somewhere", fingerprint="abc", holdout=("1",), overrides={"passes": 6.0})
EMPTY = ProjectDocument(SETTINGS)


def as_bytes(document: ProjectDocument) -> bytes:
    """A document to the last digit and sign."""
    return json.dumps(plain_document(document)).encode()


def picked_edit(edit_id: int, n_picks: int, rng: random.Random) -> Edit:
    """An edit of so many Gaussians."""
    rows = np.array(sorted(rng.sample(range(4 * n_picks + 1), n_picks)))
    return Edit(edit_id, f"pick {edit_id}", Picked((PickedRows(0, "abc", "static", pack_rows(rows)),)), Delete())


def random_events(
    rng: random.Random, n: int, history: DocumentHistory | None = None
) -> Iterator[tuple[Event, DocumentHistory]]:
    """So many events, and the history after each. history: What they go on from."""
    history = DocumentHistory(EMPTY) if history is None else history
    for number in range(n):
        event: Event = Changed(*_random_change(history.present, rng, number))
        if rng.random() < 0.25 and history.past:
            event = Undone()
        elif rng.random() < 0.2 and history.future:
            event = Redone()
        elif rng.random() < 0.5 and history.present.objects:
            one = rng.choice(history.present.objects)
            event = ObjectFound(one.object_id, one.seeds, _clips(rng))
        history = history.after(event)
        yield event, history


def _random_change(document: ProjectDocument, rng: random.Random, number: int) -> tuple[str, ProjectDocument, Any]:
    kind = rng.randrange(13)
    edits = document.edits
    new_id = max((edit.edit_id for edit in edits), default=-1) + 1
    x, y, z = (rng.uniform(-3, 3) for _ in range(3))
    if kind == 0 or (kind < 5 and not edits):
        edit = Edit(new_id, f'edit {number} "%s" ##\n', Sphere((x, y, z), abs(x) + 0.1), Expose(rng.randint(-3, 3)))
        return "add an edit", replace(document, edits=(*edits, edit)), None
    if kind == 1:
        return "pick", replace(document, edits=(*edits, picked_edit(new_id, rng.randrange(200), rng))), None
    if kind in (2, 3):
        index = rng.randrange(len(edits))
        changed = _edited(edits[index], rng)
        return "change an edit", replace(document, edits=(*edits[:index], changed, *edits[index + 1 :])), None
    if kind == 4:
        shuffled = list(edits)
        rng.shuffle(shuffled)
        return "order edits", replace(document, edits=tuple(shuffled[: rng.randint(0, len(edits))])), None
    if kind == 5:
        regions = (*document.regions, sphere_region(rng.choice(("static", "dynamic")), (x, y, z), abs(y) + 0.01))
        return "mark a region", replace(document, regions=regions[-5:]), None
    if kind == 6:
        path = turntable(np.array([x, y, z]), np.array([0.0, 0.0, 1.0]), 2.0, 0.3, (0, 29), name=f"path {number % 4}")
        others = tuple(other for other in document.camera_paths if other.name != path.name)
        return "move a key", replace(document, camera_paths=(*others, path)), ("drag", number // 20)
    if kind == 7:
        mask = PaintedMask("cam01", 0, 30, (Stroke(((0.5, abs(x) / 3), (0.6, 0.5)), 0.02),))
        excluded = Exclusions(("cam03",) if x > 0 else (), (), (*document.exclusions.masks, mask)[-3:])
        return "paint", replace(document, exclusions=excluded), "brush"
    if kind == 10:
        seed = ObjectSeed(number, (PickedRows(0, "abc", "moving", pack_rows(np.arange(rng.randrange(1, 9)))),))
        object_id = max((one.object_id for one in document.objects), default=0) + 1  # also after another start
        made = SceneObject(object_id, f"object {object_id}", seeds=(seed,))
        return "make an object", replace(document, objects=(*document.objects, made)[-3:]), None
    if kind == 11:
        return "change the time", replace(document, timing=random_timing(rng)), None
    if kind == 12:
        carried = rng.choice((None, OnPath("path 1"), OnObject(number)))
        copy_id = max((one.copy_id for one in document.copies), default=0) + 1
        copy = ObjectCopy(copy_id, f"copy {copy_id}", rng.randrange(9), Transform((x, y, z)), x, y, carried_by=carried)
        return "duplicate", replace(document, copies=(*document.copies, copy)[-4:]), ("copy", number // 9)
    if kind == 8:
        world = World((0.0, 0.0, rng.choice((1.0, -1.0))), abs(x) + 0.5) if x > 0 else World()
        return "turn the world", replace(document, world=world), None
    labels, markers = (Label("camera", f"cam{number % 5}", f"text {x}"),), (Marker(number, "clap"),)
    overrides = {"passes": rng.choice((6, 6.0, 7.5)), "seed_factor": 1} if x > 0 else {"passes": 6.0}
    settings = replace(document.settings, overrides={k: v for k, v in overrides.items() if k == "passes"})
    markers = (*document.markers, *markers)[-4:]
    return "name", replace(document, labels=labels, markers=markers, settings=settings), "type"


def _clips(rng: random.Random) -> tuple[ObjectInClip, ...]:
    sets = (PickedRows(0, "abc", "moving", pack_rows(np.arange(rng.randrange(1, 50)))),)
    return tuple(ObjectInClip(10 * i, 10 * i + 10, sets, ((10 * i, 10 * i + 7),), rng.random()) for i in range(3))


def random_timing(rng: random.Random) -> tuple[Segment, ...]:
    """Up to four segments of all kinds."""
    first = rng.randrange(20)
    kinds = (
        Segment(first, first + 9),
        Segment(first, first + 9, 0.5, 1.0 + rng.random(), "smooth", 0.1, 0.9, is_reversed=True),
        Segment(first, first + 1, n_frozen=30),
        Segment(first, first + 9, repeats=3, crossfade_frames=2),
    )
    return tuple(rng.choices(kinds, k=rng.randrange(5)))


def random_fill(edit: Edit, rng: random.Random) -> Fill:
    """What shows behind an edit; for half of them made for another one."""
    n = rng.randrange(5)
    column = np.full((n, 3), rng.random() + 0.1, np.float32)
    turns = np.tile(np.array([1, 0, 0, 0], np.float32), (n, 1))
    found = FillGaussians(column, turns, column, column[:, 0], column, column[:, 0] > 0.5)
    traces = (PickedRows(0, "abc", "static", pack_rows(np.arange(n + 1))),)
    return Fill(fill_key(edit) if rng.random() < 0.5 else "other", traces, packed_fill(found))


def _edited(edit: Edit, rng: random.Random) -> Edit:
    first = rng.randrange(20)
    prism = Prism((rng.random(), 0.0, 0.0), (1.0, 2.0, rng.random() + 0.1), ((-1.0, -1.0), (1.0, -1.0), (0.0, 1.0)))
    other = structs.replace(prism, center=(0.0, rng.random(), 1.0))
    change = rng.choice(
        (
            {"is_on": not edit.is_on},
            {"fill": random_fill(edit, rng)},
            {"name": f"name {rng.random()}"},
            {"scope": Scope(first, first + 5, rng.random() < 0.5)},
            {"target": Box((rng.random(), -0.0, 0.0), (1, 2, 3)), "is_inverted": True},
            {"target": KeyedVolume((VolumeKey(first, prism), VolumeKey(first + 0.5, other)))},
            {"action": rng.choice((Hide(), Recolor(gains=(1.0, rng.random(), 1.0)), Transform((1, 0, 0))))},
        )
    )
    return structs.replace(edit, **change)
