"""The error of a file format's reader for a file that it cannot make sense of."""

from __future__ import annotations

from engine.errors import ProjectError


def damaged(reason: str) -> ProjectError:
    """The error for a file that is not what it should be; the reason is a clause."""
    return ProjectError(f"The file of Gaussians cannot be read: {reason}.", hint="Export it again.")
