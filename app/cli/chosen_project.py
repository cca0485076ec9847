"""The project that the arguments of a command that trains clips ask for, made or opened."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from app.cli.arguments import add_follow_links, parse_cameras, parse_range, path_argument
from app.cli.training_settings import add_training_settings, overrides_of
from app.document.history import DocumentHistory
from app.document.project_document import ProjectDocument
from app.document.project_settings import ProjectSettings
from app.document.storing.document_file import PROJECT_FILE
from app.document.storing.document_store import DocumentStore
from app.project.allowed_changes import SettingsFixed, check_change, discard_unfitting, is_shared_change
from app.project.disk.discarding import discard, progress_of, training_of
from app.project.opening.project_access import (
    check_settings,
    create_project,
    default_settings,
    open_for_clips,
    open_project,
    read_settings,
)
from app.project.project import Project
from engine.capture.capture import Capture, open_capture
from engine.errors import DiskError, ProjectError
from engine.training.presets import closest_preset

_OF_TRAINING = ("scale", "frames", "clip_length", "seed", "holdout", "reference_clip", "overrides", "is_growing")
"""Settings that arguments of `train` ask for, and that all clips share."""
_N_LOOKS, _LOOK_EVERY_S = 50, 0.1


def add_project_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments that choose a capture, a project, its settings and clips of it."""
    command.add_argument("capture", type=path_argument, help="capture folder")
    command.add_argument("--project", type=path_argument, required=True, help="project folder; created if missing")
    command.add_argument("--clips", default=":", metavar="A:B", help="clips A up to B, B not included (default: all)")
    command.add_argument(
        "--frames", metavar="A:B", help="frames A up to B of the capture, B not included (default: all)"
    )
    add_follow_links(command)
    add_training_settings(command)
    command.add_argument("--seed", type=int, help="seed of initial values and of the order of pictures (default: 0)")
    command.add_argument("--reference-clip", type=int, metavar="K", help="clip that others inherit from (default: 0)")


def open_for_training(
    options: argparse.Namespace, say: Callable[[str], None], *, n_complete: int | None = None
) -> tuple[Project, Capture]:
    """The project of the arguments, made or opened; what was given has to agree with what is finished there.

    Args:
        say: Told what was discarded.
        n_complete: Frames that are complete of a capture that is still being recorded; None of any other one.
    """
    settings, stored, capture = _chosen_settings(options, n_complete)
    if stored is None:
        return create_project(options.project, settings), capture
    project = open_project(options.project)
    try:
        if options.is_starting_over:
            found = training_of(project)
            discard(project, found)
            say(f"Starting over. Discarded: {found.words or 'nothing, since nothing was trained'}")
        _check_changes(project, capture, settings)
        if settings != stored:
            project.update(settings)
            found = discard_unfitting(project, stored, settings)
            if found.progress:
                say(f"The settings have changed. Discarded: {found.words}")
    except ProjectError:
        project.close()
        raise
    return project, capture


def open_for_clip(options: argparse.Namespace) -> tuple[Project, Capture]:
    """Likewise without the project's lock, for training single clips. Where there is no project it is made, by one of
    all that try to at the same time.

    Raises:
        ProjectError: The arguments ask for other settings than the project has.
    """
    settings, stored, capture = _chosen_settings(options)
    if stored is None:
        _make_project(options.project, settings)
        settings, stored, capture = _chosen_settings(options)
    assert stored is not None
    changed = [name for name in _OF_TRAINING if getattr(settings, name) != getattr(stored, name)]
    if changed:
        listed = ", ".join(f"{name} {getattr(stored, name)!r}" for name in changed)
        raise ProjectError(
            f"The project has {listed}; single clips are trained with its settings.",
            hint="Leave the option out, or change the settings by training without --clip.",
            path=options.project,
        )
    project = open_for_clips(options.project)
    return project.placed(settings.capture, follow_links=settings.follow_links), capture


def _make_project(folder: Path, settings: ProjectSettings) -> None:
    """Make a project, or wait until another process has, which may also die of it. Raises as `create_project` does."""
    for n_left in reversed(range(_N_LOOKS)):
        try:
            create_project(folder, settings).close()
            return
        except DiskError:
            raise
        except ProjectError:
            if (folder / PROJECT_FILE).is_file():
                return
            if not n_left:
                raise
        time.sleep(_LOOK_EVERY_S)


def project_to_plan(options: argparse.Namespace) -> tuple[Project, Capture]:
    """Likewise, for looking only: nothing is made, changed or locked."""
    settings, stored, capture = _chosen_settings(options)
    document = None if stored is None else DocumentStore(options.project).read().present
    project = _unlocked(options.project, settings, document)
    if stored is not None and not options.is_starting_over:
        _check_changes(_unlocked(options.project, stored), capture, settings)
    return project, capture


def what_goes(project: Project, options: argparse.Namespace) -> str:
    """The progress that training with these arguments would discard, in words; empty for none."""
    if options.is_starting_over:
        return training_of(project).words
    stored = read_settings(project.folder) if (project.folder / PROJECT_FILE).is_file() else project.settings
    return progress_of(project).words if is_shared_change(stored, project.settings) else ""


def _chosen_settings(
    options: argparse.Namespace, n_complete: int | None = None
) -> tuple[ProjectSettings, ProjectSettings | None, Capture]:
    """Settings that the arguments ask for, those of the project where there is one, and the capture."""
    overrides = overrides_of(options)
    exists = (options.project / PROJECT_FILE).is_file()
    stored = read_settings(options.project) if exists else None
    scale = options.scale if options.scale is not None else 1.0 if stored is None else stored.scale
    follow_links = options.follow_links or (stored is not None and stored.follow_links)
    is_growing = n_complete is not None or (stored is not None and stored.is_growing)
    capture = open_capture(options.capture, scale=scale, follow_links=follow_links, is_growing=is_growing)
    capture.check_pictures()
    frames = stored.frames if stored is not None and stored.fingerprint == capture.fingerprint else None
    if n_complete is not None and frames is None:
        frames = (0, n_complete)
    if options.frames is not None:
        chosen = parse_range(options.frames, capture.n_frames, option="--frames", what="frames")
        frames = (chosen.start, chosen.stop)
    if frames is not None:
        capture = capture.resized(scale, frames)
    holdout = None if options.holdout is None else parse_cameras(options.holdout, capture)
    if stored is None:
        settings = default_settings(
            capture,
            clip_length=options.clip_length,
            holdout=holdout,
            seed=options.seed or 0,
            overrides=overrides,
            reference_clip=options.reference_clip or 0,
        )
        _check_clips(options, settings, capture)  # said before the folder is made
        return settings, None, capture
    given = {
        "scale": options.scale,
        "clip_length": options.clip_length,
        "seed": options.seed,
        "holdout": holdout,
        "reference_clip": options.reference_clip,
    }
    changes: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    if is_growing and not stored.is_growing:  # a project of what was there of it, which nothing is trained of
        changes |= {"is_growing": True, "fingerprint": capture.fingerprint}
    elif capture.fingerprint != stored.fingerprint:
        raise ProjectError(
            "The project was made for another capture.", hint="Choose another --project folder.", path=options.project
        )
    place = str(Path(capture.path).resolve())  # the capture may have moved
    is_other_preset = bool(options.preset) and closest_preset(stored.overrides) != options.preset
    kept = {} if is_other_preset else stored.overrides
    changes |= {"overrides": kept | overrides, "capture": place, "follow_links": follow_links}
    changes["frames"] = capture.frames
    settings = replace(stored, **changes)
    check_settings(settings, capture)
    _check_clips(options, settings, capture)  # before anything is discarded
    return settings, stored, capture


def _check_clips(options: argparse.Namespace, settings: ProjectSettings, capture: Capture) -> None:
    n_clips, single = len(settings.clips(capture.n_frames)), getattr(options, "clip", None)
    parse_range(options.clips, n_clips, option="--clips", what="clips")
    if single is not None and not (single >= 0 and (single < n_clips or settings.is_growing)):
        raise ProjectError(f"There is no clip {single}; clips are 0 to {n_clips - 1}.")


def _unlocked(folder: Path, settings: ProjectSettings, document: ProjectDocument | None = None) -> Project:
    known = ProjectDocument(settings) if document is None else replace(document, settings=settings)
    return Project(folder, DocumentHistory(known), None)


def _check_changes(project: Project, capture: Capture, settings: ProjectSettings) -> None:
    """Check that no clip is finished with other settings."""
    stored = project.settings
    changed = [name for name in _OF_TRAINING if getattr(settings, name) != getattr(stored, name)]
    before, after = project.document, replace(project.document, settings=settings)
    try:
        check_change(project, capture, before, after)
    except SettingsFixed as error:
        listed = ", ".join(f"{name} {getattr(stored, name)!r}" for name in changed)
        raise ProjectError(
            f"The project was trained with {listed}; this can no longer change: {training_of(project).words}.",
            hint="Leave the option out, choose another --project folder, or discard all of that with --start-over.",
            path=project.folder,
        ) from error
