"""Damaged files of a project, and of the user's own folder: what is read is what was written, or a message.

Each case damages one file of a small project: its bytes, a value of its JSON, or what lies under its name. Files are
those of this version, with checksums, and of the version before, without. The file is then read as its owner reads
it, and the whole project as `inspect`, `gate` and the timeline do. Counted as faults: an exception that is not an
EngineError, "a bug in the program", a hang, a Python file opened outside of the project, and values that differ from
what was written although the file has a checksum. A file without one can only be refused where it makes no sense.

    python -m tests.faults.fuzz_project --cases 1000 --seed 1
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import random
import shutil
import sys
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import Struct, structs, to_builtins

from engine.backends.table import backend_called
from engine.editing.actions import Delete, Hide, Transform
from engine.editing.copies.object_copy import ObjectCopy, OnPath
from engine.editing.edit import Edit, KeyedVolume, ObjectTarget, Prism, Sphere, VolumeKey
from tests.app.document.documents import random_fill, random_timing
from tests.faults.mutate import damaged_bytes, damaged_json, put_odd_file
from tests.faults.tally import Case, Outcome, fuzz_main, judge, start_memory, take_outside, watch_files

N_FRAMES = 4
BACKGROUNDS_KEY = {"capture": "none", "cameras": ["a", "b"], "size": [13, 6], "frames": 5, "is_corrected": True}
PLACE = {"phases": [["static", 3], ["joint", 5]], "phase_index": 1, "steps_in_phase": 2, "generator": [1, 2, 250]}
EXPECTED = {"frames": (N_FRAMES, N_FRAMES, N_FRAMES), "camera_names": ["a", "b", "c"], "seed": 0}
CONTENT = {"schema": 3, "clip": "abc", "cameras": ["a"]}
"""What the kept figures depend on."""
_said: list[str] = []
OLD = "old-"
"""Begins the names of the kinds without a checksum."""


# ---------------------------------------------------------------- a project


def make_project(folder: Path) -> None:
    """Two trained clips, checkpoint, live snapshot, curves, regions, paths, caches; beside them files of the user."""
    from app.document.project_settings import ProjectSettings
    from app.evaluation.kept_figures import KeptFigures
    from app.project.opening.project_access import create_project
    from app.project.recents import RecentProject
    from app.session.projects.settings import Settings
    from engine.camera.path_presets import turntable
    from engine.clip_files.clip_state import write_clip_state
    from engine.clip_files.compact import compact_clip, write_compact_clip
    from engine.editing.edit import PickedRows
    from engine.editing.picks import pack_rows
    from engine.editing.scene_object import ObjectInClip, ObjectSeed, SceneObject
    from engine.gate.regions import parse_region
    from engine.storage.array_files import write_arrays
    from engine.storage.json_files import checked_line
    from engine.training.checkpoint import write_checkpoint
    from engine.training.preparation.cloud_preparation import write_backgrounds

    reference, source = _states()
    settings = ProjectSettings("nowhere", "abc", holdout=("b",), clip_length=N_FRAMES, overrides={"passes": 6.0})
    project = create_project(folder, settings)
    regions = (parse_region({"treat": "dynamic", "box": [[0, 0, 0], [1, 2, 3]]}),)
    paths = (turntable(np.zeros(3), np.array([0.0, 0.0, 1.0]), 2.0, 0.3, (0, 9)),)
    rows = (PickedRows(0, "abc", "moving", pack_rows(np.arange(0, 90, 3))),)
    found = (ObjectInClip(0, N_FRAMES, rows, ((0, 3),), 0.7, "touching", "abc"),)
    objects = (SceneObject(1, "ball", seeds=(ObjectSeed(1, rows, rows),), clips=found, stop=3),)
    plain = {"regions": regions, "camera_paths": paths, "objects": objects}
    project.change(replace(project.document, **plain, **_edited_things()), "mark")
    project.close()
    project.clip_path(0).parent.mkdir()
    write_compact_clip(project.clip_path(0), reference)
    write_compact_clip(project.clip_path(1), compact_clip(source))
    write_clip_state(project.live_dir / "clip-0001-r0001.safetensors", source)
    write_checkpoint(project.checkpoint_path(1), _checkpoint(source))
    project.metrics_path(0).parent.mkdir()
    project.metrics_path(0).write_text("".join(map(checked_line, _rows())))
    write_backgrounds(project.prep_dir, _backgrounds(), BACKGROUNDS_KEY)
    cloud = {"points": np.ones((9, 3), np.float32), "colors": np.zeros((9, 3), np.float32)}
    write_arrays(project.first_cloud_path, cloud, {}, what="The cloud")
    figures = KeptFigures(folder / "evaluations" / "0000.jsonl", CONTENT, None, _said.append)
    with figures.writing():
        for row in _figure_rows():
            figures.add(row)
    Settings(folder / "user" / "settings.json").add_recent(RecentProject(str(folder), "nowhere", "a"))


def _edited_things() -> dict[str, Any]:
    """Edits with volumes that have keys, a fill, copies of an object, and a take that is edited in time."""
    rng = random.Random(2)
    keys = tuple(VolumeKey(float(frame), Sphere((0.0, frame, 0.0), 1.0)) for frame in (0, 3))
    prism = Prism((0.0, 0.0, 1.0), (1.0, 2.0, 3.0), ((-1.0, -1.0), (1.0, -1.0), (0.0, 1.0)))
    behind = Edit(1, "", ObjectTarget(1), Delete())
    edits = (
        structs.replace(behind, fill=random_fill(behind, rng)),
        Edit(2, "", KeyedVolume(keys), Hide()),
        Edit(3, "", KeyedVolume((VolumeKey(0.5, prism),)), Transform((1.0, 0.0, 0.0))),
    )
    copies = (
        ObjectCopy(1, "ball 1", 1, Transform((1.0, 0.0, 0.0)), 2.5, -0.5, outside="loop", group="ball group 1"),
        ObjectCopy(2, "ball 2", 1, is_in_place=True, carried_by=OnPath("turntable"), stop=3),
    )
    return {"edits": edits, "copies": copies, "timing": random_timing(rng)}


def _states() -> tuple[Any, Any]:
    """A reference clip as it is stored, and the state of one that inherits from it."""
    import torch

    from engine.clip_files.clip_state import ClipState
    from engine.clip_files.compact import compact_clip
    from tests.clip_headers import changed
    from tests.engine.model.test_clip_model import make_reference, make_source, state_of

    torch.manual_seed(0)
    entries = {"start": 0, "spacing": 0.1, "near_plane": 0.1, "moving_spacing": None, "metrics": {"training_s": 2.0}}
    entries |= {"camera_names": ["a", "b", "c"], "seed": 0, "n_steps": 8, "step": 8}
    known = state_of(make_reference(), role="reference")
    gains = {"gains": np.ones((3, 3), np.float32), "gate.static": np.zeros(20, np.uint8)}
    reference = compact_clip(ClipState(known.arrays | gains, changed(known.header, **entries)))
    known = state_of(make_source(reference.state), role="source", clip_index=1, reference=reference.state)
    return reference, ClipState(known.arrays, changed(known.header, **entries | {"start": N_FRAMES}))


def _checkpoint(state: Any) -> Any:
    from engine.clip_files.clip_header import Place
    from engine.training.checkpoint import Checkpoint
    from engine.training.step.order import ShuffledOrder

    order = ShuffledOrder(6, 3)
    order.draw()
    place = Place(order=order.state(), **PLACE)
    return Checkpoint(state, np.ones((2, 3), np.float32), _backgrounds(), place)


def _backgrounds() -> Any:
    from engine.training.preparation.cloud_preparation import Backgrounds

    rng = np.random.default_rng(3)
    return Backgrounds(rng.integers(0, 255, (2, 6, 13, 3)).astype(np.uint8), rng.random((2, 6, 13)) > 0.5)


def _figure_rows() -> list[Any]:
    from engine.metrics.clips.summary import EvalRow
    from engine.metrics.columns import COLUMNS

    figures: dict[str, float | None] = dict.fromkeys(COLUMNS, 0.5)
    return [EvalRow(0, i, "a", i % 2 == 0, figures | {"psnr": 30.0 + i}, {}) for i in range(12)]


def _rows() -> list[dict[str, Any]]:
    return [{"step": 10 * i, "loss": 1.0 / (i + 1), "held_out_psnr": 20.0 + i} for i in range(30)]


# ---------------------------------------------------------------- reading


def _plain(value: Any) -> Any:
    """Anything that was read, as something that == compares."""
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    if hasattr(value, "__dataclass_fields__"):
        return [_plain(getattr(value, name)) for name in value.__dataclass_fields__]
    if isinstance(value, Struct):
        return _plain(to_builtins(value, builtin_types=()))
    if isinstance(value, dict):
        return {name: _plain(item) for name, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


def _read_clip(project: Path, path: Path) -> Any:
    from engine.clip_files.clip_state import look_at_clip, read_clip_state
    from engine.model.reading import load_clip_model

    look_at_clip(path)
    state = read_clip_state(path)
    reference = None if state.is_reference else read_clip_state(project / "clips" / "0000.safetensors")
    load_clip_model(state, reference, backend=backend_called("cpu"))
    return state


def _read_evaluation(project: Path, path: Path) -> Any:
    from app.evaluation.kept_figures import KeptFigures

    return {repr(row) for row in KeptFigures(path, CONTENT, None, _said.append).rows.values()}, set()


def _read_checkpoint(project: Path, path: Path) -> Any:
    from engine.training.checkpoint import read_checkpoint

    return read_checkpoint(path, **EXPECTED)


def _read_document(project: Path, path: Path) -> Any:
    from app.document.storing.document_store import DocumentStore
    from app.document.storing.stored_document import plain_document

    return plain_document(DocumentStore(project).read().present)


def _read_curves(project: Path, path: Path) -> Any:
    from app.training.curves import read_curves

    curves = read_curves(path)
    return set(curves.loss), set(curves.psnr)


def _read_backgrounds(project: Path, path: Path) -> Any:
    from engine.training.preparation.cloud_preparation import read_backgrounds

    return read_backgrounds(path.parent, BACKGROUNDS_KEY)


def _read_cloud(project: Path, path: Path) -> Any:
    from app.playback.preview import read_cloud

    return [np.asarray(array) for array in (read_cloud(path).points, read_cloud(path).colors)]


def _read_preferences(project: Path, path: Path) -> Any:
    from app.session.projects.settings import Settings

    return Settings(path).recent


Read = Callable[[Path, Path], Any]
FILES: dict[str, tuple[str, Read, int]] = {
    "clip": ("clips/0000.safetensors", _read_clip, 6),
    "source clip": ("clips/0001.safetensors", _read_clip, 6),
    "live": ("live/clip-0001-r0001.safetensors", _read_clip, 3),
    "checkpoint": ("checkpoints/0001.safetensors", _read_checkpoint, 6),
    "project.json": ("project.json", _read_document, 12),
    "curves": ("metrics/0000.jsonl", _read_curves, 4),
    "backgrounds": ("prep/backgrounds.safetensors", _read_backgrounds, 3),
    "first cloud": ("prep/first_cloud.safetensors", _read_cloud, 2),
    "evaluation": ("evaluations/0000.jsonl", _read_evaluation, 2),
    "preferences": ("user/settings.json", _read_preferences, 2),
}
"""Name of a kind to its file in the project, its reader, and how often it is drawn."""
_NOTHING: tuple[Any, ...] = (None, [], (), (set(), set()))
"""What readers of files give that may be missing, when one cannot be read: made again, or empty."""


def read_project(project: Path) -> None:
    """The whole project as its listings read it.

    Raises:
        RuntimeError: A command ended with what it calls a bug in the program.
    """
    from app.cli.cli import main
    from app.project.clips.clip_catalog import ClipCatalog
    from app.project.opening.project_access import open_project
    from engine.errors import EngineError

    for command in ("inspect", "gate"):
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = main([command, str(project)])
        if code not in (0, 2) or "bug in the program" in err.getvalue() or "Traceback" in err.getvalue():
            raise RuntimeError(f"{command} ended with {code}: {err.getvalue()[-300:]}")
    with contextlib.suppress(EngineError):
        ClipCatalog(open_project(project, is_writable=False), 2)


# ---------------------------------------------------------------- damage


def damage(path: Path, rng: random.Random, *, has_checksum: bool) -> tuple[str, bool]:
    """Damage a file. Returns how, and whether a reader can tell by the checksum that it was changed."""
    is_arrays, data = path.suffix == ".safetensors", path.read_bytes()
    if not has_checksum:
        data = _without_checksum(data, path)
    kind = rng.choice(("bytes", "bytes", "value", "value", "header", "odd file"))
    if kind == "odd file":
        return put_odd_file(path, rng), has_checksum
    if kind == "bytes":
        what, data = damaged_bytes(data, rng)
    elif not is_arrays:
        first, newline, rest = data.partition(b"\n") if path.suffix == ".jsonl" else (data, b"", b"")
        what, first = damaged_json(first, rng)
        data = first + newline + rest
    else:
        n_bytes = int.from_bytes(data[:8], "little")
        table, rest = json.loads(data[8 : 8 + n_bytes]), data[8 + n_bytes :]
        texts = [name for name in ("header", "coding", "key") if name in table.get("__metadata__", {})]
        if kind == "header" and texts:
            name = rng.choice(texts)
            what, text = damaged_json(table["__metadata__"][name].encode(), rng)
            table["__metadata__"][name] = text.decode("utf-8", "replace")
            new = json.dumps(table).encode()
        else:
            what, new = damaged_json(data[8 : 8 + n_bytes], rng)
        data = len(new).to_bytes(8, "little") + new + rest
    path.write_bytes(data)
    return f"{kind}, {what}", has_checksum


def _without_checksum(data: bytes, path: Path) -> bytes:
    """The file as the version before wrote it."""
    if path.suffix == ".safetensors":
        n_bytes = int.from_bytes(data[:8], "little")
        table = json.loads(data[8 : 8 + n_bytes])
        del table["__metadata__"]["checksum"]
        text = json.dumps(table).encode()
        text += b" " * (-len(text) % 8)
        return len(text).to_bytes(8, "little") + text + data[8 + n_bytes :]
    lines = data.splitlines() if path.suffix == ".jsonl" else [data]
    rows = [json.loads(line) for line in lines]
    return b"\n".join(
        json.dumps({name: value for name, value in row.items() if name != "checksum"}).encode() for row in rows
    )


# ---------------------------------------------------------------- one case


_good: dict[str, Any] = {}
"""What each file holds before it is damaged, of this process."""


def run_case(case: Case) -> Outcome:
    """Damage a file as index and seed say, read it, and read the project."""
    rng = random.Random(zlib.crc32(f"{case.seed}:{case.index}".encode()))
    pristine = case.work_dir / "pristine"
    if not pristine.is_dir():
        for name in ("DATA", "CONFIG", "STATE"):
            os.environ[f"XDG_{name}_HOME"] = str(case.work_dir / "home")
        make_project(pristine)
        read_project(pristine)  # what loads at the first use is not the case's memory
        for name, (place, read, _) in FILES.items():
            _good[name] = _plain(read(pristine, pristine / place))
        watch_files([case.work_dir])
        start_memory()
    names = [name for name, (_, _, weight) in FILES.items() for _ in range(weight)]
    name, has_checksum = rng.choice(names), rng.random() < 0.7
    place, read, _ = FILES[name]
    project = case.work_dir / "case"
    shutil.rmtree(project, ignore_errors=True)
    shutil.copytree(pristine, project)
    path = project / place
    n_bytes = path.stat().st_size
    what, is_checked = damage(path, rng, has_checksum=has_checksum)
    if path.is_file():
        n_bytes = max(n_bytes, path.stat().st_size)
    take_outside()
    found: list[Any] = []
    verdict, detail = judge(lambda: found.append(read(project, path)))
    project_verdict, project_detail = judge(lambda: read_project(project))
    if project_verdict == "untyped":
        verdict, detail = "untyped", project_detail
    outside = take_outside()
    if outside:
        verdict, detail = "outside", ", ".join(outside)
    elif verdict == "accepted" and is_checked and not _is_as_written(name, found[0]):
        verdict, detail = "changed", f"{found[0]!r:.300}"
    shutil.rmtree(project)
    return Outcome(f"{'' if has_checksum else OLD}{name}: {what}", verdict, detail, n_bytes)


def _is_as_written(name: str, found: Any) -> bool:
    if found in _NOTHING:
        return True
    if name in ("curves", "evaluation"):  # rows may be left out, none may be changed
        return all(part <= whole for part, whole in zip(found, _good[name], strict=True))
    return bool(_plain(found) == _good[name])


if __name__ == "__main__":
    sys.exit(fuzz_main("fuzz_project", __doc__ or "", run_case))
