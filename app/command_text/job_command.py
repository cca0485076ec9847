"""Trainings and exports as commands."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from app.command_text.command_text import CommandText
from app.command_text.quoting import option
from app.document.project_settings import ProjectSettings
from app.export.jobs.job import ExportJob
from app.export.picked_frames import PickedFrames, frames_text
from engine.clip_files.clip_header import SettingValue
from engine.setting import Setting, settings_of, value_text


def training_command(
    folder: Path,
    settings: ProjectSettings,
    clip_index: int,
    *,
    is_again: bool = False,
    own: Mapping[str, SettingValue] | None = None,
) -> CommandText:
    """The command that trains a clip.

    Args:
        folder: Of the project.
        settings: Of the project.
        is_again: Whether it is trained, or damaged, and is to be trained again.
        own: Settings for this clip alone.
    """
    folder, own = folder.absolute(), dict(own or {})
    # paths are absolute, so that none of them looks like an option
    arguments = ["train", str(Path(settings.capture).absolute()), "--project", str(folder)]
    arguments += ["--clips", f"{clip_index}:{clip_index + 1}"]
    said = [str(clip_index)]
    if settings.follow_links:
        arguments.append("--follow-links")
    if is_again:
        arguments.append("--again")
        said.append("is_again=True")
    for name, value in own.items():
        arguments += ["--clip-set", f"{name}={value_text(value)}"]
    if own:
        said.append(f"settings={own!r}")
    return CommandText(tuple(arguments), f"project.train_clip({', '.join(said)})", folder)


def version_command(folder: Path, clip_index: int, number: int) -> CommandText:
    """The command that brings back an earlier version of a clip. folder: Of the project."""
    folder = folder.absolute()
    arguments = ("versions", str(folder), "--clip", str(clip_index), "--restore", str(number))
    return CommandText(arguments, f"project.restore_version({clip_index}, {number})", folder)


def mend_command(
    folder: Path, *, after: int | None = None, frames: tuple[int, int] | None = None, method: str = "auto"
) -> CommandText:
    """The command that mends a boundary or a stretch of frames.

    Args:
        folder: Of the project.
        after: The clip that begins at the boundary; None for frames.
        frames: First frame and the one after the last; None for a boundary.
        method: How, see engine.mending.figures.
    """
    folder = folder.absolute()
    said = [f"boundary={after}"] if after is not None else []
    what = ("--boundary", f"{after - 1}:{after}") if after is not None else ()
    if frames is not None:
        said, what = [f"frames=range({frames[0]}, {frames[1]})"], ("--frames", f"{frames[0]}:{frames[1]}")
    how = () if method == "auto" else ("--method", method)
    said += [] if method == "auto" else [f"method={method!r}"]
    return CommandText(("mend", str(folder), *what, *how), f"project.mend({', '.join(said)})", folder)


def export_command(folder: Path, job: ExportJob) -> CommandText:
    """The command that carries out an export. folder: Of the project."""
    folder, out = folder.absolute(), str(Path(job.out).absolute())
    declared = settings_of(type(job))
    values = {
        name: value
        for name, setting in declared.items()
        if name != "format" and (value := getattr(job, name)) != setting.default
    }
    where = ["--format", job.format_name, "--out", out] if "format" in declared else [f"--{job.kind}", out]
    arguments = [job.command, str(folder), *where]
    for name, value in values.items():
        arguments += _frames_arguments(value) if name == "frames" else _arguments(declared[name], value)
    said = [repr(out), f"format={job.format_name!r}", *(f"{name}={value!r}" for name, value in values.items())]
    kinds = {type(value).__name__: repr(value) for value in values.values()}
    names = tuple(name for name, written in kinds.items() if written.startswith(name))
    return CommandText(tuple(arguments), f"project.{job.command}({', '.join(said)})", folder, names, reads_only=True)


def _arguments(setting: Setting, value: Any) -> list[str]:
    flag = setting.flag_of(value)
    if flag.constant is not None:
        parts = ((one, getattr(value, name)) for name, one in setting.inner.items())
        return [flag.name, *(word for one, part in parts if part != one.default for word in _arguments(one, part))]
    text = setting.text(value).removeprefix(flag.prefix)
    return [flag.name, *text.split()] if isinstance(value, tuple) else list(option(flag.name, text))


def _frames_arguments(frames: PickedFrames) -> list[str]:
    step = ["--step", str(frames.step)] if frames.step != 1 else []
    return ["--frames", frames_text(frames), *step]
