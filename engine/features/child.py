"""Hands arrays to a module that uses pycolmap, in a child process of its own, and takes arrays back."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from engine.children.running import STALL_S, child_folder
from engine.children.running import run_child as run_once
from engine.storage.files import disk_error

N_ATTEMPTS = 2
"""A child that was killed or hung gets another chance: what kills it, as too little memory, need not do so again."""
FOLDER_PREFIX = "clipgstream-sparse-"
WHAT = "The pictures for matching"


class ChildFailed(Exception):
    """There is no result; says why, as a part of a sentence."""


def run_child(
    module: str,
    arrays: Mapping[str, np.ndarray],
    *,
    what: str,
    alive: Callable[[], None] = lambda: None,
    stall_s: float = STALL_S,
) -> dict[str, np.ndarray]:
    """Hand arrays to a module that ends with `engine.features.child_side.run_as_child`. Returns what it answers.

    Args:
        module: Its full name.
        arrays: By name.
        what: What it is called in reasons, as "the triangulation process".
        alive: Called several times a second; what it raises ends the child.
        stall_s: Seconds without any work of the child after which it is taken for hung.
    Raises:
        ChildFailed: The child could not be started, was killed, hung, or failed.
        DiskError: There is no room for what the child reads.
    """
    with child_folder(FOLDER_PREFIX, what=WHAT) as folder:
        job, result = folder / "job.npz", folder / "result.npz"
        try:
            np.savez(job, allow_pickle=False, **arrays)
        except OSError as error:
            raise disk_error(error, what=WHAT, path=job) from error
        reason = ""
        for _ in range(N_ATTEMPTS):
            reason, is_final = run_once(module, job, result, what=what, alive=alive, stall_s=stall_s)
            if not reason:
                with np.load(result) as answer:
                    return dict(answer)
            if is_final:
                break
        raise ChildFailed(reason)
