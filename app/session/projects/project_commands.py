"""Commands about which project is open, and where projects lie."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from app.project.opening.opening_answers import OpeningAnswers
from app.project.opening.project_choices import AS_USUAL, ProjectChoices


@dataclass(frozen=True, slots=True)
class OpenCapture:
    """Open a capture folder; where it has projects, ask which, or whether to make a new one. A project folder is opened
    as such."""

    path: Path
    scale: float | None = None
    """Share of the original picture size to work at; None picks one that suits the size."""
    is_new_project: bool = False
    """Start another project, even where there are some."""
    follow_links: bool = False
    """Whether the user allows the capture's files to lie outside of its folder; noted in its project."""
    is_asking: bool = False
    """Show a report and ask for the first settings of a project where there is none; or show why it does not open."""
    answers: OpeningAnswers | None = None
    """First settings of a new project; None takes suitable ones."""
    choices: ProjectChoices = AS_USUAL
    """How its project is opened."""


@dataclass(frozen=True, slots=True)
class OpenProject:
    """Open a project folder and the capture it names."""

    path: Path
    choices: ProjectChoices = AS_USUAL


@dataclass(frozen=True, slots=True)
class NewProject:
    """Ask for the first settings of another project of the open capture; the others stay as they are."""


@dataclass(frozen=True, slots=True)
class LeaveTraining:
    """Stop the training, keep its progress, and go to the project that was opened."""


@dataclass(frozen=True, slots=True)
class AskStartOver:
    """Ask which settings to start training over with, and show what is discarded."""


@dataclass(frozen=True, slots=True)
class StartOver:
    """Discard everything that is trained in the open project, and take a preset."""

    preset: str


@dataclass(frozen=True, slots=True)
class SetProjectsFolder:
    """Where projects go that are made from now on; an empty text for the usual place."""

    folder: str


@dataclass(frozen=True, slots=True)
class ForgetRecent:
    """Take a project or capture out of the list of recent ones; its files stay."""

    folder: Path


OpenCommand = OpenCapture | OpenProject
"""Commands that open a project."""

ProjectCommand = OpenCommand | NewProject | LeaveTraining | AskStartOver | StartOver | SetProjectsFolder | ForgetRecent
"""Commands on the project that is open, and where projects lie."""
