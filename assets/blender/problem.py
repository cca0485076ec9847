# SPDX-License-Identifier: MIT
"""SequenceProblem: why a sequence cannot be shown, in words for the user."""

from pathlib import Path


class SequenceProblem(Exception):
    """Input that cannot be used. The message is the cause, what to do, and the path last."""

    def __init__(self, cause: str, hint: str, path: Path) -> None:
        super().__init__(f"{cause} {hint} {path}")
