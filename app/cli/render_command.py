"""clipgstream render: a camera of the capture from trained clips, as a video or as PNG files."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from app.cli.arguments import EXIT_OK, parse_cameras, parse_range, path_argument
from app.cli.terminal.progress import ProgressLine, row_progress
from app.cli.terminal.results import check_writable
from app.evaluation.headless import open_trained, render_frames
from app.project.project import open_project
from app.training.service import Launch
from engine.errors import ProjectError

VIDEO_SUFFIXES = (".mp4", ".m4v", ".mov")


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream render`."""
    command.add_argument("project", type=path_argument, help="project folder")
    command.add_argument("--camera", required=True, metavar="NAME", help="camera of the capture")
    command.add_argument("--frames", default=":", metavar="A:B", help="frames A up to B, B not included (default: all)")
    command.add_argument(
        "--out", type=path_argument, required=True, metavar="FILE.mp4|DIR", help="video, or folder for PNGs"
    )
    command.add_argument(
        "--features",
        choices=("both", "static", "dynamic"),
        default="both",
        help="show what the static or the dynamic features of the anchors carry (default: both)",
    )
    command.add_argument("--quiet", action="store_true", help="no progress")


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream render: write the pictures of a camera. Returns the exit code."""
    from app.cli.video import write_pictures, write_video

    opened = open_trained(open_project(options.project, is_writable=False))
    capture = opened.capture
    chosen = parse_cameras(options.camera, capture)
    if len(chosen) != 1:
        raise ProjectError(f"--camera is '{options.camera}'; one camera can be rendered at a time.")
    camera_index = capture.rig.names.index(chosen[0])
    frames = parse_range(options.frames, capture.n_frames, option="--frames", what="frames")
    if options.frames.strip() == ":":
        frames = [f for i in opened.trained for f in opened.clips[i].frame_indices()]
    line = ProgressLine(is_quiet=options.quiet)
    progress = row_progress(line, "Rendering")

    def images() -> Iterator[tuple[int, Any]]:
        rendered = render_frames(opened, camera_index=camera_index, frame_indices=frames, features=options.features)
        for done, item in enumerate(rendered, start=1):
            yield item
            progress(done, len(frames), None)

    out: Path = options.out
    if out.suffix.lower() in VIDEO_SUFFIXES:
        check_writable(out)
        n_images = write_video(out, (image for _, image in images()), fps=capture.fps)
    elif out.suffix and not out.is_dir():
        raise ProjectError(
            f"--out ends in '{out.suffix}', which is not a video format this program writes.",
            hint="Write FILE.mp4, or name a folder for PNG files.",
            path=out,
        )
    else:
        check_writable(out / "frame.png")
        n_images = write_pictures(out, images())
    line.say(f"{n_images} frames of camera {chosen[0]} in {out}")
    return EXIT_OK
