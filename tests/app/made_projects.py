"""Projects made of headers: tiny clip files that say what trained ones say, without any training."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from app.document.project_settings import ProjectSettings
from app.project.opening.project_access import create_project
from app.project.project import Project
from engine.clip_files.clip_header import ClipHeader
from engine.clip_files.clip_state import ClipState, write_clip_state
from tests.app.fakes import anchor_arrays
from tests.clip_headers import make_header


def clip_header(clip_index: int, **entries: Any) -> ClipHeader:
    """Header of a finished reference clip; entries replace or add."""
    metrics = {"held_out_psnr": 20.0 + clip_index % 7, "preparation_s": 2.0, "training_s": 8.0}
    own = {"clip_index": clip_index, "start": clip_index, "fingerprint": f"clip-{clip_index}", "metrics": metrics}
    return make_header(**(own | entries))


def write_header(path: Path, header: ClipHeader) -> None:
    """A clip file, or a checkpoint, with this header and next to no arrays."""
    write_clip_state(path, ClipState(anchor_arrays("static"), header))


def make_project(folder: Path, **settings: Any) -> Project:
    """A project of no capture."""
    return create_project(
        folder, ProjectSettings(**({"capture": "none", "fingerprint": "none", "clip_length": 1} | settings))
    )


def make_chain(folder: Path, n_clips: int, **settings: Any) -> Project:
    """A project of trained clips, each of which inherits from the first and goes on from the one before."""
    project = make_project(folder, overrides={"field": "continue"}, **settings)
    for index in range(n_clips):
        entries = {"role": "source", "reference_fingerprint": "clip-0", "previous_fingerprint": f"clip-{index - 1}"}
        write_header(project.clip_path(index), clip_header(index, **(entries if index else {})))
    return project
