"""clipgstream render: the trained scene as a video, or as a folder of PNG or OpenEXR files."""

from __future__ import annotations

import argparse
import re
from typing import Any

from app.cli.arguments import EXIT_OK, parse_cameras, parse_range, path_argument
from app.cli.terminal.progress import ProgressLine
from app.evaluation.headless import TrainedProject, open_trained
from app.project.project import open_project
from app.training.service import Launch
from engine.errors import ProjectError


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream render`."""
    from app.export.video.formats import FORMATS
    from app.export.video.job import PASSES, Turntable

    command.add_argument("project", type=path_argument, help="project folder")
    view = command.add_mutually_exclusive_group(required=True)
    view.add_argument("--camera", metavar="NAME", help="look through a camera of the capture, in its colours")
    view.add_argument("--path", metavar="NAME", help="along a camera path of the project")
    view.add_argument("--turntable", action="store_true", help="circle around the scene")
    command.add_argument(
        "--out", type=path_argument, required=True, metavar="FILE|DIR", help="FILE.mp4, FILE.webm, or a new folder"
    )
    command.add_argument(
        "--format", choices=tuple(FORMATS), help="what to write (default: by the name; PNG files into a folder)"
    )
    command.add_argument(
        "--frames",
        default=":",
        metavar="A:B",
        help="frames A up to B, B not included (default: all that are trained, or those of the path)",
    )
    command.add_argument(
        "--show", choices=tuple(PASSES), default="color", help="what pictures show (default: color); " + _passes(PASSES)
    )
    command.add_argument("--size", metavar="WxH", help="width and height in pixels (default: those of the capture)")
    command.add_argument("--fps", type=float, help="pictures per second (default: those of the capture)")
    command.add_argument("--speed", type=float, default=1.0, help="0.25: four times slower than it was (default: 1)")
    command.add_argument("--hold", type=float, metavar="FRAME", help="the scene stands still there, the camera moves")
    command.add_argument(
        "--supersampling", type=int, default=1, metavar="N", help="draw N times as large and reduce (default: 1)"
    )
    command.add_argument("--background", metavar="#RRGGBB", help="colour behind the scene (default: black)")
    command.add_argument("--transparent", action="store_true", help="no background: keep the opacity of the scene")
    command.add_argument("--sound", metavar="CAMERA", help="the sound that this camera recorded goes along")
    turntable = Turntable()
    command.add_argument("--turns", type=float, help=f"of the turntable (default: {turntable.n_turns:g})")
    command.add_argument(
        "--elevation", type=float, help=f"of the turntable, degrees (default: {turntable.elevation_deg:g})"
    )
    command.add_argument("--radius", type=float, help="of the turntable, scene units (default: that of the cameras)")
    command.add_argument(
        "--features",
        choices=("both", "static", "dynamic"),
        default="both",
        help="show what the static or the dynamic features of the anchors carry (default: both)",
    )
    command.add_argument("--without-edits", action="store_true", help="the scene as it was trained")
    command.add_argument("--quiet", action="store_true", help="no progress")


def _passes(passes: dict[Any, str]) -> str:
    return "; ".join(f"{name}: {words}" for name, words in passes.items() if name != "color")


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream render: write pictures. Returns the exit code."""
    from app.export.video.render import render_video

    opened = open_trained(open_project(options.project, is_writable=False))
    job = _job(options, opened)
    line = ProgressLine(is_quiet=options.quiet)
    written = render_video(job, opened, lambda progress: line.update(progress.stage, progress.done, progress.message))
    for note in written.notes:
        line.say(note)
    if written.depth_unit is not None:
        line.say(f"One level of the 16 bits is {written.depth_unit:g} scene units; 0 is where nothing is.")
    width, height = written.size
    pictures = f"{written.n_pictures} picture{'' if written.n_pictures == 1 else 's'} of {width} x {height}"
    line.say(f"{pictures}, {written.fps:g} per second, {written.n_bytes / 1e6:.1f} MB, in {written.out}")
    return EXIT_OK


def _job(options: argparse.Namespace, opened: TrainedProject) -> Any:
    """The job that the arguments ask for. Raises ProjectError where one cannot be understood."""
    from app.export.video.formats import FORMATS, format_of
    from app.export.video.job import Turntable, VideoJob

    capture, out = opened.capture, options.out
    chosen = None if options.frames.strip() == ":" else options.frames
    frames = None if chosen is None else parse_range(chosen, capture.n_frames, option="--frames", what="frames")
    format_name = options.format or format_of(out)
    suffixes = FORMATS[format_name].suffixes
    if suffixes and out.suffix.lower() not in suffixes:
        raise ProjectError(
            f"--format is {format_name}, but --out ends in '{out.suffix}'.", hint=f"Name a file {suffixes[0]}."
        )
    turntable = None
    circle = {"n_turns": options.turns, "elevation_deg": options.elevation, "radius": options.radius}
    circle = {name: value for name, value in circle.items() if value is not None}
    if options.turntable:
        turntable = Turntable(**circle)
    elif circle:
        raise ProjectError("--turns, --elevation and --radius belong to --turntable.", hint="Leave them out.")
    return VideoJob(
        out=out,
        format=format_name,
        camera=None if options.camera is None else _camera(options.camera, "--camera", opened),
        path=options.path,
        turntable=turntable,
        frames=None if frames is None else (frames.start, frames.stop),
        shows=options.show,
        size=None if options.size is None else _size(options.size),
        fps=options.fps,
        speed=options.speed,
        hold=options.hold,
        supersampling=options.supersampling,
        background=(0, 0, 0) if options.background is None else _color(options.background),
        is_transparent=options.transparent,
        sound=None if options.sound is None else _camera(options.sound, "--sound", opened),
        features=options.features,
        has_edits=not options.without_edits,
    )


def _camera(text: str, option: str, opened: TrainedProject) -> str:
    if text in opened.capture.rig.names:  # one name, whatever is in it
        return text
    chosen = parse_cameras(text, opened.capture)
    if len(chosen) != 1:
        raise ProjectError(f"{option} is '{text}'; one camera can be taken at a time.")
    return chosen[0]


def _size(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d{1,6})[xX×](\d{1,6})", text.strip())
    if found is None:
        raise ProjectError(f"--size is '{text}', which is not WIDTHxHEIGHT.", hint="Write for instance 1280x720.")
    return int(found[1]), int(found[2])


def _color(text: str) -> tuple[int, int, int]:
    found = re.fullmatch(r"#?([0-9a-fA-F]{2})([0-9a-fA-F]{2})([0-9a-fA-F]{2})", text.strip())
    if found is None:
        raise ProjectError(f"--background is '{text}', which is not a colour.", hint="Write #RRGGBB, as #ffffff.")
    return int(found[1], 16), int(found[2], 16), int(found[3], 16)
