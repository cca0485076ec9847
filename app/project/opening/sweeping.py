"""Remains of a killed program in a project are removed when the project is opened for writing."""

from __future__ import annotations

import logging
import re
from collections.abc import Collection
from pathlib import Path

from app.project.claims.left_over import live_claims, sweep_claims
from app.project.lock import is_process_alive
from engine.storage.files import PARTIAL_PREFIX, discard, is_left_over

logger = logging.getLogger(__name__)

LIVE_NAME = re.compile(
    r"(clip-(?P<shown>[\d-]{4,19})-r\d{4,9}|(?P<kept>[\d-]{4,19})(-p\d{1,9}(-[0-9a-f]{8})?)?-final|mended-\d{4,9})\.safetensors"
)
"""Files that the program makes in "live": snapshots, a finished clip that is read back, drafts of mended clips."""


def sweep(folder: Path) -> None:
    """Remove snapshots and what is half-written. Finished files stay, and so does whatever the program has not made.

    What another process is writing stays too, such as the report of a project that trains, and what belongs to a clip
    that another one has claimed.

    Args:
        folder: Of the project, see app.project.folders.
    """
    sweep_claims(folder)
    live = list((folder / "live").glob("*"))
    claimed = live_claims(folder)  # after that: whoever made one of them has claimed its clip before
    found = [path for path in live if _is_swept(path.name, claimed)]
    found += [path for path in folder.rglob(f"{PARTIAL_PREFIX}*") if is_left_over(path, is_process_alive)]
    n_gone = sum(map(discard, found))
    if n_gone:
        logger.info("removed %d leftover files from %s", n_gone, folder)


def _is_swept(name: str, claimed: Collection[str]) -> bool:
    match = LIVE_NAME.fullmatch(name)
    return match is not None and match["shown"] not in claimed and match["kept"] not in claimed
