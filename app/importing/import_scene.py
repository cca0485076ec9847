"""A scene of another program as a project: its frames become clips without training, seen from virtual cameras."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.document.changes.world_changes import set_scale
from app.document.project_document import ProjectDocument
from app.document.project_settings import ProjectSettings
from app.document.storing.document_store import DocumentStore
from app.project.clips.clip_names import clip_name
from app.project.opening.project_access import is_project
from engine.capture.capture import open_capture
from engine.capture.clip import cut_clips
from engine.capture.formats.imported import write_imported
from engine.clip_files.clip_state import read_clip_state, write_clip_state
from engine.errors import ProjectError
from engine.export.splats import PLY_UP, Splats
from engine.export.world import AXES
from engine.importing.scene_source import SceneSource, open_scene
from engine.importing.stored_clip import stored_clip, with_near_plane
from engine.importing.stored_rows import stored_gaussians
from engine.importing.views import VIEW_NAMES, Contents
from engine.storage.files import atomic_folder, disk_error

SCENE = "scene"
"""The folder of a project with the views of its scene, in one that has its name."""
CLIP_LENGTH = 20
CLIP_BYTES = 192 << 20
"""Of the frames of a clip: as many are in memory while it is made."""
GAUSSIAN_BYTES = 56
NEAR_SHARE = 0.05
"""Near plane of all clips, as a share of the distance from which the views see the scene."""
DEFAULT_FPS = 30.0
FPS_LIMITS = 0.01, 1000.0

Report = Callable[[int, int], None]
"""Frames done, and all. May raise to end the work."""


@dataclass(frozen=True, slots=True)
class ImportedScene:
    """What was made.

    Attributes:
        folder: Of the project.
        n_frames, n_clips: Of the scene.
        notes: What is odd, or not kept, as sentences.
    """

    folder: Path
    n_frames: int
    n_clips: int
    notes: tuple[str, ...]


def import_scene(
    path: Path,
    folder: Path,
    *,
    fps: float | None = None,
    up: str | None = None,
    meters_per_unit: float | None = None,
    report: Report = lambda n_done, n: None,
) -> ImportedScene:
    """Make a project of a scene. It appears complete, or not at all.

    Args:
        path: See engine.importing.scene_source.open_scene.
        folder: Of the project: new or empty.
        fps: Frames per second; None for what the scene says, else DEFAULT_FPS.
        up: One of engine.export.world.AXES; None for what the scene says, else -y as in most files of Gaussians.
        meters_per_unit: Length of a unit of the scene, m; None where unknown.
        report: Receives the progress.
    Raises:
        ProjectError: The scene or the folder cannot be used, or a value is not possible.
        DiskError: The disk refused.
    """
    if folder.is_symlink() or folder.is_file() or (folder.is_dir() and any(folder.iterdir())):
        raise ProjectError("This name is already taken.", hint="Give a new or empty folder.", path=folder)
    if any(is_project(parent) for parent in folder.absolute().parents):
        raise ProjectError("This place is inside a project.", hint="Choose another place.", path=folder)
    source = open_scene(path)
    try:
        rate = fps if fps is not None else source.fps or DEFAULT_FPS
        if not FPS_LIMITS[0] <= rate <= FPS_LIMITS[1]:
            what = f"{rate:g} frames per second is not between {FPS_LIMITS[0]:g} and {FPS_LIMITS[1]:g}."
            raise ProjectError(what, hint="Give another number.", path=path)
        name = path.resolve().name.encode("utf-8", "replace").decode()
        with atomic_folder(folder) as partial:
            n_clips = _fill(partial, source, name, rate, up, meters_per_unit, report)
        return ImportedScene(folder, source.n_frames, n_clips, source.notes)
    except OSError as error:
        raise disk_error(error, what="The project", path=folder) from error
    finally:
        source.close()


def _fill(
    folder: Path,
    source: SceneSource,
    name: str,
    fps: float,
    up: str | None,
    meters_per_unit: float | None,
    report: Report,
) -> int:
    """Write all of the project; returns the number of clips."""
    clips, scene, contents = folder / "clips", folder / SCENE / name, Contents()
    for made in (clips, scene):
        made.mkdir(parents=True)
    clip_length, bounds = min(CLIP_LENGTH, source.n_frames), [0]
    waiting: list[Splats] = []

    def end_clip() -> None:
        bounds.append(bounds[-1] + len(waiting))
        clip = cut_clips(bounds, clip_length)[-1]
        found = stored_gaussians(waiting)
        contents.add(found)
        write_clip_state(clips / f"{clip.clip_index}", stored_clip(clip, found, views=VIEW_NAMES))
        waiting.clear()

    for frame in range(source.n_frames):
        report(frame, source.n_frames)
        splats = source.splats(frame)
        n_bytes = GAUSSIAN_BYTES * (sum(map(len, waiting)) + len(splats))
        if len(waiting) == clip_length or (waiting and n_bytes > CLIP_BYTES):
            end_clip()
        waiting.append(splats)
    end_clip()
    for index in range(len(bounds) - 1):  # names depend on all bounds, and the near plane on all contents
        draft = clips / f"{index}"
        state = with_near_plane(read_clip_state(draft), NEAR_SHARE * contents.distance)
        write_clip_state(clips / f"{clip_name(index, tuple(bounds), clip_length)}.safetensors", state)
        draft.unlink()
    report(source.n_frames, source.n_frames)
    rig = contents.views(np.array(AXES[up] if up is not None else source.up or PLY_UP))
    write_imported(scene, rig, n_frames=source.n_frames, fps=fps, source=name, notes=source.notes, place=source.place)
    settings = ProjectSettings(
        capture=str(scene.resolve()),
        fingerprint=open_capture(scene).fingerprint,
        clip_length=clip_length,
        overrides={"independent": True},
        clip_bounds=None if bounds[:-1] == list(range(0, source.n_frames, clip_length)) else tuple(bounds),
    )
    DocumentStore(folder).create(set_scale(ProjectDocument(settings), meters_per_unit))
    return len(bounds) - 1
