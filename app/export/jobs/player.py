"""PlayerJob: a page that plays the scene in a browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, ClassVar

from app.export.jobs.job import EDITS, FRAMES, TIMING, ExportJob, option
from app.export.picked_frames import PickedFrames
from engine.setting import Flag


class PlayerJob(ExportJob, frozen=True):
    """An export of a player to an HTML page."""

    kind: ClassVar[str] = "player"
    title: ClassVar[str] = "Player"
    about: ClassVar[str] = "A page that plays the scene in a browser, with free view control; it works offline."
    work: ClassVar[str] = "app.export.player_job"
    needs_trained: ClassVar[bool] = True

    frames: Annotated[PickedFrames | None, FRAMES] = None
    has_folder: Annotated[
        bool | None,
        option(
            "Where the scene is stored",
            "Scene",
            none="in the page up to 150 MB, in a folder above that",
            titles={"": "Depending on size", "false": "In the page", "true": "In a folder beside it"},
            flags=(
                Flag("--data-folder", "A folder of clips beside the page, which are loaded as it plays", constant=True),
                Flag("--one-file", "Everything in the page, however large that becomes", constant=False),
            ),
        ),
    ] = None
    has_edits: Annotated[bool, EDITS] = True
    has_timing: Annotated[bool, TIMING] = True

    @classmethod
    def suffix(cls, format_name: str) -> str:
        """See `ExportJob`."""
        return ".html"

    @property
    def folder(self) -> Path:
        """The folder of clips that are not in the page."""
        return self.out.with_name(f"{self.out.stem}_data")
