"""MetricsJob: every figure that was measured."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from app.export.jobs.job import FRAMES, ExportJob, option
from app.export.picked_frames import PickedFrames


class MetricsJob(ExportJob, frozen=True):
    """An export of metrics to a file. Clips that are not trained are left out."""

    kind: ClassVar[str] = "metrics"
    title: ClassVar[str] = "Metrics"
    about: ClassVar[str] = "Every measured figure, with the training settings."
    work: ClassVar[str] = "app.export.metrics_job"
    is_prefixed: ClassVar[bool] = True

    format: Annotated[
        Literal["csv", "json"],
        option(
            "What is written",
            "Format",
            answers={
                "csv": ("CSV", "a table for a spreadsheet, with a row per clip, frame and camera"),
                "json": ("JSON", "the same with neighbouring frames, and all settings of every clip"),
            },
        ),
    ] = "csv"
    frames: Annotated[PickedFrames | None, FRAMES] = None

    @classmethod
    def suffix(cls, format_name: str) -> str:
        """See `ExportJob`."""
        return f".{format_name}"
