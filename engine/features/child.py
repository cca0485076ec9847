"""Hands arrays to work that uses pycolmap, in a child process of its own, and takes arrays back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from engine.children.folder import child_folder
from engine.children.kind import STALL_S, ChildFailed, ChildKind
from engine.children.process import run_child
from engine.progress import Progress
from engine.storage.files import disk_error

N_ATTEMPTS = 2
"""A child that was killed or hung gets another chance: what kills it, as too little memory, need not do so again."""
FOLDER_PREFIX = "clipgstream-sparse-"
WHAT = "The pictures for matching"
ArraysKind = ChildKind[Path, Progress, None]
"""Work on the folder where arrays lie."""


def arrays_kind(place: str, work: str, what: str) -> ArraysKind:
    """A kind of child for `work_on_arrays`; see `ChildKind`. Its work calls engine.features.child_side.answer."""
    return ChildKind(place=place, work=work, what=what, job=Path, stall_s=STALL_S, is_spreading=True)


def work_on_arrays(
    kind: ArraysKind,
    arrays: Mapping[str, np.ndarray],
    *,
    alive: Callable[[], None] = lambda: None,
    stall_s: float = STALL_S,
) -> dict[str, np.ndarray]:
    """Hand arrays to a child. Returns what it answers.

    Args:
        kind: The kind of work on them.
        arrays: By name.
        alive: Called several times a second; what it raises ends the child.
        stall_s: Seconds without any work of the child after which it is taken for hung.
    Raises:
        ChildFailed: The child could not be started, was killed, hung, or failed.
        DiskError: There is no room for what the child reads.
    """
    with child_folder(FOLDER_PREFIX, what=WHAT) as folder:
        job = folder / "job.npz"
        try:
            np.savez(job, allow_pickle=False, **arrays)
        except OSError as error:
            raise disk_error(error, what=WHAT, path=job) from error
        for attempt in range(N_ATTEMPTS):
            try:
                run_child(kind, folder, alive=alive, stall_s=stall_s, folder=folder)
                break
            except ChildFailed as error:
                if error.is_final or attempt == N_ATTEMPTS - 1:
                    raise
        with np.load(folder / "result.npz") as answer:
            return dict(answer)
