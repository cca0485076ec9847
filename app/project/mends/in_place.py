"""Mended clips take the place of what they were, all of them or none; and the way back.

What they were are versions like any other (app.project.clips.clip_versions). Files are replaced one after the other;
while that happens, mends/unfinished.json says so, and whoever opens the project next after a crash takes it back.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from msgspec.structs import replace as with_entries

from app.project.clips.clip_versions import (
    forget_oldest,
    list_versions,
    remove_version,
    restore_version,
    set_aside,
    why_not,
)
from app.project.mends.record import (
    UNFINISHED,
    MendedClip,
    MendRecord,
    keep_record,
    read_record,
    records_dir,
    write_record,
)
from app.project.project import Project
from engine.clip_files.clip_state import read_clip_header
from engine.errors import ProjectError
from engine.storage.files import disk_error, replace_file

logger = logging.getLogger(__name__)


def put_in_place(project: Project, record: MendRecord, drafts: Mapping[int, Path]) -> int:
    """Let mended clips take the place of what they were, which become versions.

    Args:
        project: Open for writing.
        record: With the clips that changed.
        drafts: Their files by clip index, on the disk of the project; they are moved.
    Returns:
        The number of the record.
    Raises:
        ProjectError: The project is read-only, or a clip was trained meanwhile; nothing has changed.
        DiskError: The disk refused; all clips are as they were.
    """
    project.check_writable()
    for clip in record.clips:
        if _fingerprint(project, clip.clip_index) != clip.before:
            raise ProjectError(
                f"Clip {clip.clip_index} was trained or restored while it was mended, and was not changed.",
                hint="Mend it again.",
            )
        header = read_clip_header(drafts[clip.clip_index])
        reason = "The mended clip cannot be read." if header is None else why_not(project, clip.clip_index, header)
        if reason:
            raise ProjectError(reason, hint="Mend it again.")
    unfinished = records_dir(project) / UNFINISHED
    write_record(unfinished, record)
    try:
        for clip in record.clips:
            set_aside(project, clip.clip_index, unless=clip.after)
        for clip in record.clips:
            path = project.clip_path(clip.clip_index)
            try:
                replace_file(drafts[clip.clip_index], path, is_durable=True)
            except OSError as error:
                raise disk_error(error, what="The mended clip", path=path) from error
        number = keep_record(project, record)
    except BaseException:  # an interruption, too
        _take_back(project, record)
        unfinished.unlink(missing_ok=True)
        raise
    with suppress(OSError):
        unfinished.unlink(missing_ok=True)
    for clip in record.clips:
        forget_oldest(project, clip.clip_index)
    return number


def take_back(project: Project, record: MendRecord) -> None:
    """Bring back clips as they were before they were mended; the present ones become versions.

    Raises:
        ProjectError: One of them is no longer the result of that mending, or its version is gone; nothing changes.
        DiskError: The disk refused.
    """
    project.check_writable()
    reason = why_not_back(project, record)
    if reason:
        raise ProjectError(reason, hint="The clip's menu lists the versions that can be restored.")
    record = as_cut_now(project, record)
    unfinished = records_dir(project) / UNFINISHED
    write_record(unfinished, record)  # killed in between, it is taken back to the end when the project is opened
    _take_back(project, record)
    with suppress(OSError):
        unfinished.unlink(missing_ok=True)


def as_cut_now(project: Project, record: MendRecord) -> MendRecord:
    """The record with the indices that its clips have now: splitting or merging clips before them gives them others.

    A clip that is not what mending has made of it keeps the index that it had.
    """

    def now(clip: MendedClip) -> MendedClip:
        if _fingerprint(project, clip.clip_index) == clip.after:
            return clip
        indices = (index for index, _ in project.finished_clips() if _fingerprint(project, index) == clip.after)
        return with_entries(clip, clip_index=next(indices, clip.clip_index))

    return with_entries(record, clips=tuple(map(now, record.clips)))


def why_not_back(project: Project, record: MendRecord) -> str:
    """Why a mend cannot be taken back; empty where it can."""
    for clip in as_cut_now(project, record).clips:
        if _fingerprint(project, clip.clip_index) != clip.after:
            return f"Clip {clip.clip_index} was trained or restored since it was mended."
        if version_before(project, clip) is None:
            return f"The version of clip {clip.clip_index} from before it was mended is gone."
    return ""


def recover(project: Project) -> None:
    """Take back what a killed program had put in place in part. The project is open for writing.

    Raises:
        DiskError: The disk refused.
    """
    path = records_dir(project) / UNFINISHED
    try:
        record = read_record(path)
    except ProjectError as error:  # it was never complete: then nothing was replaced either
        logger.warning("%s", error)
        record = None
    if record is not None:
        logger.info("taking back %s, which was interrupted", record.words)
        _take_back(project, record)
    path.unlink(missing_ok=True)


def _take_back(project: Project, record: MendRecord) -> None:
    """As far as there is something to take back. A clip that was trained meanwhile stays."""
    for clip in record.clips:
        number, now = version_before(project, clip), _fingerprint(project, clip.clip_index)
        if number is None:
            continue
        if now == clip.before:  # it was set aside, and no more
            remove_version(project, clip.clip_index, number)
        elif now in (clip.after, None):
            restore_version(project, clip.clip_index, number)


def version_before(project: Project, clip: MendedClip) -> int | None:
    """The version that a mended clip was before; None where that is gone."""
    versions = list_versions(project, clip.clip_index)
    found = (one.number for one in versions if one.header is not None and one.header.fingerprint == clip.before)
    return next(found, None)


def _fingerprint(project: Project, clip_index: int) -> str | None:
    found = project.headers.read(project.clip_path(clip_index))
    return None if found is None or found.header is None else found.header.fingerprint
