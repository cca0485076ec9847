"""CamerasJob: the cameras of a project's capture."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from app.export.jobs.job import ExportJob, option


class CamerasJob(ExportJob, frozen=True):
    """An export of cameras to a new or empty folder."""

    kind: ClassVar[str] = "cameras"
    title: ClassVar[str] = "Cameras"
    about: ClassVar[str] = "Poses and lenses of the capture's cameras."
    work: ClassVar[str] = "app.export.cameras_job"
    is_prefixed: ClassVar[bool] = True

    format: Annotated[
        Literal["colmap", "transforms", "usd"],
        option(
            "What is written",
            "Format",
            answers={
                "colmap": ("COLMAP", "a folder with COLMAP's sparse model, as text"),
                "transforms": ("transforms.json", "a folder with transforms.json of nerfstudio"),
                "usd": ("USD", "a folder with cameras.usda, with all camera paths, for compositing"),
            },
        ),
    ] = "colmap"
