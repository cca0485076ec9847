"""Trainings and exports as commands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from app.command_text.command_text import CommandText
from app.command_text.quoting import number, option
from app.document.project_settings import ProjectSettings
from app.export.export_jobs import Job
from app.export.named_jobs import JOB_FORMATS, format_name_of
from app.export.picked_frames import PickedFrames
from engine.clip_files.clip_header import SettingValue
from engine.training.setting import value_text


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
        own: Settings that it alone is to have.
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


def export_command(folder: Path, kind: str, job: Job) -> CommandText:
    """The command that carries out an export.

    Args:
        folder: Of the project.
        kind: One of app.export.export_jobs.KINDS.
        job: Of this kind.
    """
    folder, out = folder.absolute(), str(Path(job.out).absolute())
    format_name = format_name_of(kind, job)
    values = _differing(format_name, job)
    if kind == "video":
        arguments = ["render", str(folder), *_view_arguments(values), "--out", out, "--format", format_name]
        arguments += _video_arguments(values)
    else:
        arguments = ["export", str(folder)]
        arguments += ["--player", out] if kind == "player" else ["--format", format_name, "--out", out]
        arguments += _export_arguments(values)
    said = [repr(out), f"format={format_name!r}"]
    if kind == "video" and "frames" in values:
        values = values | {"frames": range(*values["frames"])}
    said += [f"{name}={value!r}" for name, value in values.items()]
    names = tuple(type(value).__name__ for value in values.values() if hasattr(value, "__dataclass_fields__"))
    call = "render" if kind == "video" else "export"
    return CommandText(tuple(arguments), f"project.{call}({', '.join(said)})", folder, names, reads_only=True)


def _differing(format_name: str, job: Job) -> dict[str, Any]:
    """Entries of a job that are not the usual ones, beside its format and place."""
    said = ("out", *JOB_FORMATS[format_name].fixed)
    return {
        field.name: getattr(job, field.name)
        for field in fields(job)  # type: ignore[arg-type]
        if field.name not in said and getattr(job, field.name) != field.default
    }


def _export_arguments(values: Mapping[str, Any]) -> list[str]:
    arguments: list[str] = []
    for name, value in values.items():
        match name:
            case "frames":
                arguments += _frames_arguments(value)
            case "up":
                arguments += ["--up" if value.startswith("+") else "--down", value[1:]]
            case "scale":
                arguments += ["--scale", number(float(value))]
            case "has_edits":
                arguments += [] if value else ["--without-edits"]
            case "has_folder":
                arguments.append("--data-folder" if value else "--one-file")
            case "scene_up":
                arguments += ["--scene-up", *(number(float(part)) for part in value)]
            case _:
                arguments += [f"--{name.replace('_', '-')}", str(value)]
    return arguments


def _frames_arguments(frames: range | PickedFrames) -> list[str]:
    runs: Sequence[range] = frames.runs if isinstance(frames, PickedFrames) else (frames,)
    step = frames.step
    text = ",".join(f"{run.start}:{run.stop}" for run in runs)
    return ["--frames", text, *(["--step", str(step)] if step != 1 else [])]


def _view_arguments(values: Mapping[str, Any]) -> list[str]:
    if values.get("camera") is not None:
        return list(option("--camera", values["camera"]))
    if values.get("path") is not None:
        return list(option("--path", values["path"]))
    return ["--turntable"]


def _video_arguments(values: Mapping[str, Any]) -> list[str]:
    arguments: list[str] = []
    for name, value in values.items():
        match name:
            case "camera" | "path":
                pass
            case "turntable":
                arguments += ["--turns", number(value.n_turns), "--elevation", number(value.elevation_deg)]
                arguments += [] if value.radius is None else ["--radius", number(value.radius)]
            case "frames":
                arguments += ["--frames", f"{value[0]}:{value[1]}"]
            case "shows":
                arguments += ["--show", value]
            case "size":
                arguments += ["--size", f"{value[0]}x{value[1]}"]
            case "fps" | "speed" | "hold":
                arguments += [f"--{name}", number(float(value))]
            case "background":
                arguments += ["--background", "#{:02x}{:02x}{:02x}".format(*value)]
            case "is_transparent":
                arguments.append("--transparent")
            case "has_edits":
                arguments += [] if value else ["--without-edits"]
            case "sound":
                arguments += option("--sound", value)
            case _:
                arguments += [f"--{name}", str(value)]
    return arguments
