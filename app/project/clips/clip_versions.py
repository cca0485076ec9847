"""Versions of finished clips: earlier results, kept next to the clip and brought back on request.

PROJECT/versions/0003/0002.safetensors is the second version of clip 3 that was set aside, 0002.jsonl its curves. Both
are the files that lay in clips/ and metrics/, with their own checksums. A version that comes back is moved; the clip
in its place is set aside in turn. At every moment there is a complete file under the clip's name.
"""

from __future__ import annotations

import os
import shutil
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from msgspec.structs import replace

from app.project.clips.clip_names import PROGRAM_NAME
from app.project.project import Project
from engine.clip_files.clip_header import ClipHeader
from engine.clip_files.clip_state import ClipState, read_clip_state
from engine.errors import ProjectError
from engine.storage.files import atomic_path, disk_error, replace_file

DAMAGED = "damaged"
"""Folder of damaged files that were put aside."""
MAX_VERSIONS = 3
"""Of one clip; the one that was set aside first goes."""


@dataclass(frozen=True, slots=True)
class ClipVersion:
    """A version of a clip as it lies on disk. A value.

    Attributes:
        number: Names it; one that was set aside later has a higher number.
        path: The clip file.
        trained_s: When it was trained, seconds since 1970.
        n_bytes: Size of the file.
        header: None where it is damaged.
        damage: Why it cannot be read; empty for a good one.
    """

    number: int
    path: Path
    trained_s: float
    n_bytes: int
    header: ClipHeader | None
    damage: str = ""

    @property
    def revision(self) -> str:
        """A name of its contents; equal for equal content."""
        return "" if self.header is None else f"version-{self.header.fingerprint}"


def version_path(project: Project, clip_index: int, number: int) -> Path:
    """The file of a version."""
    return versions_dir(project, clip_index) / f"{number:04d}.safetensors"


def versions_dir(project: Project, clip_index: int) -> Path:
    """The folder of a clip's versions."""
    return project.folder / "versions" / project.clip_name(clip_index)


def list_versions(project: Project, clip_index: int) -> list[ClipVersion]:
    """Versions of a clip, the one set aside last first. Reads their headers, and no other files."""
    found = []
    for number in _numbers(project, clip_index):
        path = version_path(project, clip_index, number)
        header = project.headers.read(path)
        if header is not None:
            trained_s = 0.0
            with suppress(OSError):
                trained_s = path.stat().st_mtime
            found.append(ClipVersion(number, path, trained_s, header.n_bytes, header.header, header.damage))
    return found[::-1]


def _numbers(project: Project, clip_index: int) -> list[int]:
    """Rising."""
    try:
        names = os.listdir(versions_dir(project, clip_index))
    except OSError:
        return []
    stems = [name.removesuffix(".safetensors") for name in names if name.endswith(".safetensors")]
    return sorted(int(stem) for stem in stems if stem.isascii() and stem.isdecimal() and 4 <= len(stem) <= 9)


# ---------------------------------------------------------------- keeping


def set_aside(project: Project, clip_index: int, *, unless: str = "") -> int | None:
    """Keep the finished clip and its curves as a version, under their names as well. See `forget_oldest`.

    A damaged clip does not become a version; it is kept as well, see `put_damaged_aside`.

    Args:
        unless: Fingerprint of the clip that replaces it: an equal clip is not kept twice.
    Returns:
        Its number; None where there is no readable clip, or an equal one.
    Raises:
        DiskError: The disk refused; the clip stays where it is.
    """
    found = project.headers.read(project.clip_path(clip_index))
    if found is None or (found.header is not None and found.header.fingerprint == unless):
        return None
    if found.header is None or not _is_whole(project.clip_path(clip_index)):
        put_damaged_aside(project, clip_index)
        return None
    number = max(_numbers(project, clip_index), default=0) + 1
    target = version_path(project, clip_index, number)
    try:
        for folder in (target.parent.parent, target.parent):
            folder.mkdir(exist_ok=True)  # not the project itself, which may be gone
        _link_or_copy(project.clip_path(clip_index), target)
    except OSError as error:
        raise disk_error(error, what="The earlier version of the clip", path=target) from error
    with suppress(OSError):  # curves are worth less than the clip
        _link_or_copy(project.metrics_path(clip_index), target.with_suffix(".jsonl"))
    return number


def put_damaged_aside(project: Project, clip_index: int) -> Path | None:
    """Keep the damaged file of a clip in the folder "damaged", under its name as well, for whoever can still make use
    of it. Returns where; None where there is no file.

    Raises:
        DiskError: The disk refused; the file stays where it is.
    """
    path, folder = project.clip_path(clip_index), project.folder / DAMAGED
    if not path.is_file():
        return None
    name = project.clip_name(clip_index)
    try:
        folder.mkdir(exist_ok=True)
        taken = set(os.listdir(folder))
        number = next(n for n in range(1, len(taken) + 2) if f"{name}-{n}.safetensors" not in taken)
        target = folder / f"{name}-{number}.safetensors"
        _link_or_copy(path, target)
    except OSError as error:
        raise disk_error(error, what="The damaged file of the clip", path=folder) from error
    return target


def best_version(project: Project, clip_index: int) -> ClipVersion | None:
    """The version of a clip that was set aside last and could come back now; None without one. Reads headers only."""
    for version in list_versions(project, clip_index):
        if version.header is not None and not why_not(project, clip_index, version.header):
            return version
    return None


def recovery_hint(project: Project, clip_index: int) -> str:
    """The remedy for a damaged clip, as a sentence for an error."""
    version = best_version(project, clip_index)
    if version is None:
        return f"Restore it from a backup, or train clip {clip_index} again."
    return (
        f"Restore its earlier version with clipgstream versions PROJECT --clip {clip_index} --restore "
        f"{version.number}, restore it from a backup, or train clip {clip_index} again."
    )


def read_finished(project: Project, clip_index: int) -> ClipState:
    """A finished clip. Its header says which clip it is now, also where clips before it were split or merged since.

    Raises:
        ProjectError: It is damaged; says which version of it could come back.
    """
    try:
        state = read_clip_state(project.clip_path(clip_index))
    except ProjectError as error:
        raise ProjectError(error.message, hint=recovery_hint(project, clip_index), path=error.path) from error
    if state.header.clip_index == clip_index:
        return state
    return ClipState(state.arrays, replace(state.header, clip_index=clip_index))


def _is_whole(path: Path) -> bool:
    try:
        read_clip_state(path)
    except ProjectError:
        return False
    return True


def forget_oldest(project: Project, clip_index: int) -> None:
    """Remove the versions of a clip that were set aside first, until MAX_VERSIONS are left. A disk that refuses keeps
    them a while longer."""
    for number in _numbers(project, clip_index)[:-MAX_VERSIONS]:
        with suppress(ProjectError):
            remove_version(project, clip_index, number)


def _link_or_copy(source: Path, target: Path) -> None:
    """The same file under another name, or a copy where the file system has no links. Times stay."""
    with atomic_path(target, makes_parents=False) as partial:
        try:
            os.link(source, partial)
        except OSError:
            shutil.copy2(source, partial)


def remove_version(project: Project, clip_index: int, number: int) -> None:
    """Delete a version and its curves; what is not there is no fault.

    Raises:
        DiskError: The disk refused.
    """
    path = version_path(project, clip_index, number)
    try:
        path.with_suffix(".jsonl").unlink(missing_ok=True)  # first: curves alone are those of a version that came back
        path.unlink(missing_ok=True)
    except OSError as error:
        raise disk_error(error, what="The removal of a version", path=path) from error
    with suppress(OSError):  # others are left
        path.parent.rmdir()


# ---------------------------------------------------------------- bringing back


def restore_version(project: Project, clip_index: int, number: int) -> None:
    """Bring a version back as the finished clip; what is finished now becomes a version.

    Clips that were trained on either know by its fingerprint whether they still fit, as after any training. Reads the
    whole file first; takes a second.

    Raises:
        ProjectError: The project is read-only, or there is no such version, or it is damaged or does not fit.
        DiskError: The disk refused; the finished clip is as it was.
    """
    project.check_writable()
    path = version_path(project, clip_index, number)
    if not path.is_file():
        raise ProjectError(f"Clip {clip_index} has no version {number}.", path=path)
    header = read_clip_state(path).header
    reason = why_not(project, clip_index, header)
    if reason:
        raise ProjectError(reason, hint="Remove it, or put the file back in its place.", path=path)
    set_aside_number = set_aside(project, clip_index, unless=header.fingerprint)
    clip_path = project.clip_path(clip_index)
    try:
        clip_path.parent.mkdir(exist_ok=True)
        replace_file(path, clip_path, is_durable=True)
    except OSError as error:
        if set_aside_number is not None:
            with suppress(OSError, ProjectError):
                remove_version(project, clip_index, set_aside_number)
        raise disk_error(error, what="The clip", path=clip_path) from error
    _bring_curves(path.with_suffix(".jsonl"), project.metrics_path(clip_index))


def _bring_curves(source: Path, target: Path) -> None:
    """Put the curves of a version that came back in the place of those of the clip that was set aside."""
    with suppress(OSError):
        if source.is_file():
            os.replace(source, target)
        else:
            target.unlink(missing_ok=True)


def finish_restoring(folder: Path) -> None:
    """Bring the curves of a version that came back when the program was killed just then. folder: Of the project."""
    for curves in sorted((folder / "versions").glob("*/*.jsonl")):
        name = curves.parent.name
        if (
            not (curves.stem.isdecimal() and PROGRAM_NAME.fullmatch(name))
            or curves.with_suffix(".safetensors").exists()
        ):
            continue
        if (folder / "clips" / f"{name}.safetensors").is_file():
            _bring_curves(curves, folder / "metrics" / f"{name}.jsonl")


def why_not(project: Project, clip_index: int, header: ClipHeader) -> str:
    """Why a clip file cannot be clip `clip_index` of this project now; empty where it can."""
    start, stop = project.frames_of(clip_index)
    if header.start != start or (stop is not None and header.start + header.n_frames > stop):
        last = header.start + header.n_frames - 1
        return f"The version covers frames {header.start} to {last}, not clip {clip_index}."
    base = project.inherited_index(clip_index)
    if header.role != ("reference" if base is None else "source"):
        return "The version was trained before another clip was made the reference."
    found = project.headers.read(project.clip_path(clip_index))
    current = None if found is None else found.header
    if current is not None:
        of_project = (current.start, current.n_frames, current.clip_length, current.camera_names)
        if (header.start, header.n_frames, header.clip_length, header.camera_names) != of_project:
            return "The version belongs to another project with other frames or cameras."
    known = None if base is None else project.headers.read(project.clip_path(base))
    if header.role == "source" and base is not None:
        fingerprint = None if known is None or known.header is None else known.header.fingerprint
        if header.reference_fingerprint != fingerprint:
            return f"The version was trained on another version of clip {base}, the reference; restore that first."
    return ""


def reference_file(project: Project, clip_index: int, header: ClipHeader) -> Path | None:
    """The file with which a clip's version can be shown: the reference, or the version of it that it was trained on.

    None where it inherits nothing, or where that reference is gone.
    """
    base = project.inherited_index(clip_index)
    if header.role != "source" or base is None:
        return None
    found = project.headers.read(project.clip_path(base))
    if found is not None and found.header is not None and found.header.fingerprint == header.reference_fingerprint:
        return project.clip_path(base)
    for version in list_versions(project, base):
        if version.header is not None and version.header.fingerprint == header.reference_fingerprint:
            return version.path
    return None
