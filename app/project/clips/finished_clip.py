"""A finished clip on its way into the project: its worker has left it there, and the holder of its claim puts it in its
place. What the clip was before becomes a version. Nobody else replaces a finished clip by a trained one."""

from __future__ import annotations

import logging
import os
from contextlib import suppress

from app.project.claims.claims import Claims
from app.project.clips.clip_versions import forget_oldest, set_aside
from app.project.project import Project
from engine.clip_files.clip_state import read_clip_header
from engine.errors import ProjectError
from engine.storage.files import discard, disk_error, replace_file
from engine.training.preparation.stages import remove_stages

logger = logging.getLogger(__name__)


def take_in(project: Project, clip_index: int) -> bool:
    """Put a clip that its worker has left in its place, and what its training needed away. Reads the earlier clip, if
    there is one, and waits for the disk.

    Returns:
        Whether there was one.
    Raises:
        ProjectError: This process may not train clips.
        DiskError: The disk refused; everything is as it was, and it can be tried again.
    """
    project.check_trainable()
    files = project.files(clip_index)
    header = read_clip_header(files.handed_over)
    if header is None:
        return False
    set_aside(project, clip_index, unless=header.fingerprint)
    try:
        files.clip.parent.mkdir(exist_ok=True)  # not the project itself, which may be gone
        replace_file(files.handed_over, files.clip, is_durable=True)
    except OSError as error:
        raise disk_error(error, what="The clip", path=files.clip) from error
    forget_oldest(project, clip_index)
    try:
        if files.unfinished_metrics.is_file():
            os.replace(files.unfinished_metrics, files.metrics)
    except OSError as error:
        logger.warning("the curves could not be stored (%s)", error.strerror)
    discard(files.checkpoint)
    remove_stages(project.prep_dir, clip_index)
    return True


def take_in_left_over(project: Project) -> None:
    """Put every clip in its place that was finished when the program was killed, but for those that another process
    has claimed, which may live. A disk that refuses keeps it for the next time."""
    claims = Claims(project.folder, has_thread=False)
    for path in sorted(project.live_dir.glob("*-trained.safetensors")):
        key = path.name.removesuffix("-trained.safetensors")
        clip_index = project.index_of(key)
        if clip_index is not None:
            with suppress(ProjectError):
                claims.take(key)
                take_in(project, clip_index)
    claims.close()
