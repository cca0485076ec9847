"""The table of commands: name, purpose, and the module that is imported once the command is used.

Each module has `add_arguments(parser)` and `run(options, launch)`. Nothing here imports them, so that a command costs
nothing until it is called, and the product does not depend on the laboratory whose commands are named here too.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, NamedTuple, Protocol, cast

from engine.own_modules import import_own

if TYPE_CHECKING:
    from app.training.service import Launch

_GOES_ON = "Progress is kept; the same command resumes from there."


class CommandModule(Protocol):
    """The functions of a command's module."""

    def add_arguments(self, command: argparse.ArgumentParser) -> None:
        """Declare the command's arguments."""
        ...

    def run(self, options: argparse.Namespace, launch: Launch) -> int:
        """Do the work; returns the exit code. `launch` starts a training worker."""
        ...


class Command(NamedTuple):
    """One subcommand.

    Attributes:
        summary: Its purpose, in one line for the list of commands and for its own help.
        module: Where its arguments and its work are.
        interrupted: State of the work after an interruption, in addition to the words of the interruption itself.
        has_backend: Whether clips are trained, decoded or drawn, with the back end of `--backend`.
    """

    summary: str
    module: str
    interrupted: str = ""
    has_backend: bool = False

    def load(self) -> CommandModule:
        """Import the command's module."""
        return cast("CommandModule", import_own(self.module))


COMMANDS = {
    "train": Command(
        "train clips of a capture, or resume training", "app.cli.train_command", _GOES_ON, has_backend=True
    ),
    "follow": Command(
        "train the clips of a capture while it is still being recorded",
        "app.cli.captures.follow_command",
        _GOES_ON,
        has_backend=True,
    ),
    "schedule": Command(
        "write a job for SLURM, OpenJD or a shell that trains the clips on many computers",
        "app.cli.schedule_command",
        "No job was written.",
        has_backend=True,
    ),
    "eval": Command(
        "measure trained clips against every camera, and the seams between them",
        "app.cli.eval_command",
        "The result was not written.",
        has_backend=True,
    ),
    "apply": Command(
        "remove deleted anchors from the clips for good",
        "app.cli.projects.apply_command",
        "Clips and edits are consistent either way.",
        has_backend=True,
    ),
    "mend": Command(
        "reduce a seam between two clips, or flicker in a range of frames, and measure it",
        "app.cli.projects.mend_command",
        "All clips are as they were.",
        has_backend=True,
    ),
    "render": Command(
        "render the scene as a video or a sequence of pictures",
        "app.cli.render_command",
        "Nothing was written.",
        has_backend=True,
    ),
    "export": Command(
        "write Gaussians, a player, figures or cameras for other programs",
        "app.cli.export_command",
        "Nothing was written.",
        has_backend=True,
    ),
    "import": Command(
        "open a scene of another program: a file over time, or .ply, .splat, .spz or .sog, one per frame",
        "app.cli.projects.import_command",
        "Nothing was written.",
    ),
    "blender": Command(
        "write the add-on with which Blender opens exported sequences", "app.cli.addons.blender_command"
    ),
    "inspect": Command(
        "examine and correct a capture, or show the size of a project's trained clips",
        "app.cli.captures.inspect_command",
    ),
    "calibrate": Command(
        "calibrate the cameras of a folder of plain videos, making it a capture",
        "app.cli.captures.calibrate_command",
        "Nothing was written.",
    ),
    "board": Command(
        "write a calibration board to print, which `calibrate --board` looks for",
        "app.cli.captures.board_command",
        "Nothing was written.",
    ),
    "synchronise": Command(
        "measure how far each camera is ahead of the others, and optionally correct it",
        "app.cli.captures.synchronise_command",
        "Nothing was changed.",
    ),
    "convert": Command(
        "write a capture in another layout: COLMAP, transforms.json or capture.json",
        "app.cli.captures.convert_command",
        "Nothing was written.",
    ),
    "clips": Command(
        "list the clips of a project, split and merge them, choose the reference", "app.cli.projects.clips_command"
    ),
    "versions": Command(
        "list and restore earlier versions of clips, and free disk space",
        "app.cli.projects.versions_command",
    ),
    "exclude": Command("leave cameras and pictures out of training", "app.cli.projects.exclude_command"),
    "edit": Command(
        "list and change the edits of a project, undo and redo",
        "app.cli.projects.editing.edit_command",
        "Nothing was changed.",
        has_backend=True,
    ),
    "object": Command(
        "make objects of a project, find them in its clips, and correct them",
        "app.cli.projects.editing.object_command",
        "Nothing was changed.",
        has_backend=True,
    ),
    "gate": Command("show what is static in a project and why, and overrule it", "app.cli.projects.gate_command"),
    "repair": Command("show what is left of a damaged project, and repair it", "app.cli.projects.repair_command"),
    "doctor": Command(
        "check this machine: versions, memory, compiled kernels, OpenGL, disk", "app.cli.captures.doctor_command"
    ),
    "desktop": Command(
        "put the program into the menu of a Linux desktop, or take it out of it",
        "app.cli.installing.desktop_command",
    ),
    "bench": Command("measure speed against error, of kernels and settings, on this machine", "app.lab.bench.command"),
    "report": Command(
        "write a report page about a project, alone or next to others",
        "app.lab.report.command",
        "The page was not written.",
        has_backend=True,
    ),
    "ablate": Command(
        "train variants of the method and baselines, and compare them",
        "app.lab.ablation.command",
        _GOES_ON,
        has_backend=True,
    ),
}
"""Subcommands that run without a window."""
