"""clipgstream export --format ply|compressed-ply|spz|splat|glb|sog: Gaussians, a file per frame."""

from __future__ import annotations

import argparse

from app.evaluation.headless import TrainedProject
from app.export.export_progress import ExportResult, Report
from app.export.gaussian_files import WRITTEN_PARTS
from app.export.named_jobs import run_named_job
from app.export.picked_frames import PickedFrames

_AXES = ("x", "y", "z")
FORMATS = {
    "ply": "floats, for nearly all programs",
    "compressed-ply": "a third of that",
    "spz": "a quarter, for Niantic, Blender, Spark and others",
    "splat": "for older viewers",
    "glb": "glTF with KHR_gaussian_splatting",
    "sog": "the smallest, for PlayCanvas",
}
"""Names of `engine.export.formats.table.FORMATS` in a few words; that table is loaded once it is needed."""


OPTIONS = ("part", "up", "down", "scale", "axes", "scene_up")
TAKES_EDITS = True


def takes_frames(format_name: str) -> bool:
    """Whether frames can be chosen."""
    return True


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Options of Gaussians."""
    own = command.add_argument_group("Gaussians")
    own.add_argument(
        "--part",
        choices=WRITTEN_PARTS,
        default="all",
        help="all of the scene, what stands still (once), what moves (per frame), or split: both apart (default: all)",
    )
    turn = own.add_mutually_exclusive_group()
    turn.add_argument(
        "--up", choices=_AXES, help="turn the scene so that this axis points up (default: as in the capture)"
    )
    turn.add_argument("--down", choices=_AXES, help="turn the scene so that this axis points down")
    own.add_argument(
        "--scene-up",
        nargs=3,
        type=float,
        metavar=("X", "Y", "Z"),
        help="which way is up in the capture, for --up and --down (default: as the project says, else what its cameras "
        "agree on)",
    )
    own.add_argument(
        "--scale",
        type=float,
        metavar="S",
        help="units of the files per unit of the capture (default: metres where the project says how long a unit is, "
        "else 1)",
    )
    own.add_argument(
        "--axes",
        choices=("ply", "rub"),
        default="ply",
        help="ply: axes as in .ply files; rub: y and z reversed, as Niantic's programs take .spz (default: ply)",
    )


def export(
    opened: TrainedProject, options: argparse.Namespace, frames: range | PickedFrames | None, report: Report
) -> ExportResult:
    """Write the files. Raises ProjectError."""
    return run_named_job(
        opened,
        report,
        options.format,
        options.out,
        frames=frames,
        part=options.part,
        up=f"+{options.up}" if options.up else f"-{options.down}" if options.down else None,
        scale=options.scale,
        axes=options.axes,
        has_edits=not options.without_edits,
        scene_up=None if options.scene_up is None else tuple(options.scene_up),
    )
