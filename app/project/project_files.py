"""The JSON files of a project: settings, regions of the gate, curves. Read strictly, written with checksums.

An edit by hand is accepted where the entry "checksum" was taken out; otherwise it looks like damage, and the message
says so.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta

from app.project.clip_names import bounds_problem
from app.project.kept_json import read_kept, write_kept
from engine.capture.clip import Clip, cut_clips, split_clips
from engine.clip_files.clip_header import SettingValue
from engine.errors import ProjectError
from engine.gate.regions import GateRegion, parse_region
from engine.storage.json_files import HAND_EDITED, read_checked_lines
from engine.storage.typed_json import EntryError, to_type
from engine.training.config import TrainConfig, config_of
from engine.training.retired_settings import without_retired

logger = logging.getLogger(__name__)

SCHEMA = 1
PROJECT_FILE = "project.json"
GATE_FILE = "gate.json"
_MAX_COUNT = 2**31
"""Frames and clips are fewer."""


@dataclass(frozen=True, slots=True)
class ProjectSettings:
    """What every clip of a project has in common. A value; saved as project.json.

    Attributes:
        capture: Folder of the capture.
        fingerprint: Of the capture, to notice another one in its place.
        scale: Share of the original picture size, in (0, 1].
        clip_length: M, frames per clip.
        holdout: Names of the cameras that training never sees.
        seed: Fixes initial values and the order of pictures.
        overrides: Training settings that differ from the defaults.
        reference_clip: Index of the clip that the others inherit from.
        follow_links: Whether the user allowed the capture's files to lie outside of its folder.
        frames: First frame of the capture that is worked on, and the one after the last; None for all.
        clip_bounds: Where clips were split or merged: the first frame of every clip, and at the end the number of
            frames. None where every clip has clip_length frames, the last one what is left.
    """

    capture: Annotated[str, Meta(pattern=r"\A[^\0]*\Z")]
    fingerprint: str
    scale: Annotated[float, Meta(gt=0, le=1)] = 1.0
    clip_length: Annotated[int, Meta(ge=1, lt=2**31)] = 10
    holdout: tuple[str, ...] = ()
    seed: Annotated[int, Meta(ge=0, lt=2**32)] = 0
    overrides: dict[str, SettingValue] = field(default_factory=dict)
    reference_clip: Annotated[int, Meta(ge=0, lt=2**31)] = 0
    follow_links: bool = False
    frames: tuple[Annotated[int, Meta(ge=0, lt=2**31)], Annotated[int, Meta(ge=1, lt=2**31)]] | None = None
    clip_bounds: tuple[Annotated[int, Meta(ge=0, lt=2**31)], ...] | None = None
    schema: int = SCHEMA

    def clips(self, n_frames: int) -> list[Clip]:
        """The clips of a capture of that many frames.

        Raises:
            ProjectError: The project's clips were cut from a capture of another length.
        """
        if self.config().field == "joint":
            return split_clips(n_frames, n_frames)
        if self.clip_bounds is None:
            return split_clips(n_frames, self.clip_length)
        if self.clip_bounds[-1] != n_frames:
            raise ProjectError(
                f"The project's clips end at frame {self.clip_bounds[-1]}, but there are {n_frames} frames.",
                hint="Put the original capture back, or make a new project.",
            )
        return cut_clips(self.clip_bounds, self.clip_length)

    def config(self) -> TrainConfig:
        """The training settings. Raises ProjectError for an unknown one or a value that it may not have."""
        return config_of(self.overrides)


def read_settings(folder: Path) -> ProjectSettings:
    """Read project.json.

    Raises:
        ProjectError: It is missing, damaged, of a newer schema, or holds unknown or ill-typed values.
    """
    path = folder / PROJECT_FILE
    content = read_kept(path, "The project file", hint="Restore it from a copy.")
    if content is None:
        if not folder.exists():
            raise ProjectError("There is no such folder.", hint="Check the path.", path=folder)
        raise ProjectError(
            f"This is not a project folder: it has no {PROJECT_FILE}.",
            hint="Train a capture first, or open the folder that holds that file.",
            path=folder,
        )
    if content.get("schema") != SCHEMA or type(content["schema"]) is not int:
        raise ProjectError(
            f"The project has schema {content.get('schema')!r:.60}, this version reads {SCHEMA}.",
            hint="Use the version that wrote it, or restore the file from a copy.",
            path=path,
        )
    unknown = sorted(content.keys() - {item.name for item in fields(ProjectSettings)})
    if unknown:
        raise ProjectError(
            f"The project file has unknown entries: {', '.join(unknown):.200}.", hint=HAND_EDITED, path=path
        )
    try:
        settings = to_type(content, ProjectSettings)
        settings = replace(settings, overrides=without_retired(settings.overrides))
        settings.config()
        if settings.clip_bounds is not None and bounds_problem(settings.clip_bounds):
            raise EntryError(bounds_problem(settings.clip_bounds))
    except ProjectError as error:
        raise ProjectError(error.message, hint="Correct it or restore the file from a copy.", path=path) from error
    except EntryError as error:
        raise ProjectError(
            f"The project file has a missing or wrong entry ({error}).", hint="Restore it from a copy.", path=path
        ) from error
    return settings


def write_settings(folder: Path, settings: ProjectSettings) -> None:
    """Write project.json.

    Raises:
        DiskError: The disk refused.
    """
    write_kept(folder / PROJECT_FILE, asdict(settings))


def read_regions(path: Path) -> tuple[GateRegion, ...]:
    """Regions of gate.json; none where there is no such file.

    Raises:
        ProjectError: The file is damaged or holds something that is not a region.
    """
    hint = "Correct or remove the file."
    content = read_kept(path, "The file of the gate's regions", hint=hint)
    if content is None:
        return ()
    if content.keys() != {"regions"} or not isinstance(content["regions"], list):
        raise ProjectError('The file holds something else than a list "regions".', hint=hint, path=path)
    try:
        return tuple(parse_region(values) for values in content["regions"])
    except ProjectError as error:
        raise ProjectError(error.message, hint=error.hint, path=path) from error


def write_regions(path: Path, regions: Sequence[GateRegion]) -> None:
    """Write gate.json.

    Raises:
        DiskError: The disk refused.
    """
    write_kept(path, {"regions": [region.as_dict() for region in regions]})


def read_metrics(path: Path) -> list[dict[str, Any]]:
    """Rows of a metrics file, each with its step; lines that are unfinished or damaged are left out."""
    try:
        rows, n_damaged = read_checked_lines(path)
    except FileNotFoundError:
        return []
    except OSError as error:
        logger.warning("the curves cannot be read (%s) - %s", error.strerror, path)
        return []
    good = [row for row in rows if type(row.get("step")) is int and 0 <= row["step"] < _MAX_COUNT]
    n_damaged += len(rows) - len(good)
    if n_damaged:
        logger.warning("%d damaged rows of curves were left out - %s", n_damaged, path)
    return good
