"""Errors a user can act on.

EngineError
|-- CaptureError      a capture folder cannot be used; carries every problem found
|   |-- OutsideError  a file of it lies outside of its folder, which the user may allow
|-- ProjectError      a project folder, clip state or configuration cannot be used
|   |-- DiskError     a file could not be written: nothing is wrong with what was asked for
|-- PreparationError  clouds or masks could not be built from this capture
|-- TrainingError     training could not continue
    |-- NonFiniteLoss the loss or a gradient stopped being a number

Messages state the cause first, with numbers, then what was done; the hint says what to do; the path comes last.
Programming mistakes are assertions or ValueError/TypeError, not these.
"""

from collections.abc import Sequence
from pathlib import Path

from engine.text import printable

MAX_LISTED_PROBLEMS = 20
"""Problems of a capture that its message lists; all are kept."""


class EngineError(Exception):
    """A failure with a cause, a hint and where it happened.

    Args:
        message: Cause first, with numbers, then what was done about it. One sentence or two, no path.
        hint: The remedy for the user. May be empty.
        path: File or folder concerned, shown last.
    """

    def __init__(self, message: str, *, hint: str = "", path: Path | str | None = None) -> None:
        self.message = printable(message)  # names and values of files go into it
        self.hint = printable(hint)
        self.path = None if path is None else Path(path)
        super().__init__(str(self))

    def __str__(self) -> str:
        text = " ".join(part for part in (self.message, self.hint) if part)
        return f"{text} - {self._place}" if self.path is not None else text

    @property
    def _place(self) -> str:
        return printable(str(self.path)).replace("\n", "\\n")

    def parts(self) -> tuple[str, str]:
        """The message and the remedy, for those who show them apart. Joined by a space they are str(self)."""
        if self.hint and self.path is not None:
            return self.message, f"{self.hint} - {self._place}"
        return str(EngineError(self.message, path=self.path)), self.hint


class CaptureError(EngineError):
    """A capture folder cannot be used. `problems` lists everything that is wrong, not only the first thing."""

    def __init__(
        self, message: str, *, hint: str = "", path: Path | str | None = None, problems: Sequence[EngineError] = ()
    ) -> None:
        self.problems = tuple(problems)
        super().__init__(message, hint=hint, path=path)

    def __str__(self) -> str:
        listed = [f"  {problem}" for problem in self.problems[:MAX_LISTED_PROBLEMS]]
        n_more = len(self.problems) - len(listed)
        return "\n".join([super().__str__(), *listed, *([f"  and {n_more} more like these."] if n_more else [])])

    def parts(self) -> tuple[str, str]:
        """As of every error; listed problems carry their own hints and stand with what happened."""
        return (str(self), "") if self.problems else super().parts()

    def said_of(self, what: str) -> "CaptureError":
        """The same kind of problem with what it is of named in front, as `Camera "a"`."""
        return type(self)(f"{what}: {self.message}", hint=self.hint, path=self.path)

    @property
    def needs_links(self) -> bool:
        """Whether nothing is wrong but that files lie outside of the folder, so that follow_links helps."""
        return bool(self.problems) and all(isinstance(problem, OutsideError) for problem in self.problems)


class OutsideError(CaptureError):
    """A file of a capture lies outside of its folder, and the user has not said that it may."""

    @property
    def needs_links(self) -> bool:
        """Whether the missing permission is the only problem."""
        return True


class ProjectError(EngineError):
    """A project folder, a clip state or a configuration value cannot be used."""


class DiskError(ProjectError):
    """A file could not be written, for instance on a full disk: a failure, and no bad input."""


class PreparationError(EngineError):
    """Clouds, masks or backgrounds could not be built."""


class TrainingError(EngineError):
    """Training could not continue."""


class NonFiniteLoss(TrainingError):
    """The loss or a gradient stopped being a finite number; nothing was changed by it."""
