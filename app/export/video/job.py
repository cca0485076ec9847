"""VideoJob: what is to be drawn and written, as a plain value that can be stored and sent to another process."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from app.export.video.formats import FORMATS
from engine.errors import ProjectError

if TYPE_CHECKING:
    from engine.metrics.clips.features_apart import Features

PassName = Literal["color", "depth", "opacity", "change", "compare"]
PASSES: dict[PassName, str] = {
    "color": "the scene in its colours",
    "depth": "distance along the viewing axis",
    "opacity": "how much of what lies behind is covered",
    "change": "what differs from the moment before, seen from the same place",
    "compare": "what the camera took, the render, and the error between them, side by side",
}
"""What pictures can show."""
MAX_SUPERSAMPLING = 8
MAX_SIDE_PX, MAX_PIXELS = 16_384, 1 << 27
"""Of a picture as it is drawn, before it is reduced: as long as H.264 allows, and some gigabytes of memory."""
MAX_PICTURES = 1_000_000
MAX_TURNS = 100
FPS_RANGE = (0.1, 1000.0)
SPEED_RANGE = (0.001, 1000.0)


@dataclass(frozen=True, slots=True)
class Turntable:
    """A camera on a circle around what all cameras look at, with the up direction that they agree on.

    Attributes:
        n_turns: Turns from the first picture to the one that would follow the last, so that whole turns make a loop.
            Seen from above, positive ones go counterclockwise.
        elevation_deg: Height above the horizon, degrees.
        radius: Distance to the middle, scene units; None for the mean distance of the cameras.
    """

    n_turns: float = 1.0
    elevation_deg: float = 20.0
    radius: float | None = None


@dataclass(frozen=True, slots=True)
class VideoJob:
    """One video, or one folder of pictures. Of `camera`, `path` and `turntable` exactly one is given.

    Attributes:
        out: File, or folder of a sequence.
        format: One of app.export.video.formats.FORMATS.
        camera: Name of a capture camera that is looked through, in its own colours.
        path: Name of a camera path of the project.
        turntable: A circle around the scene.
        frames: First frame and the one after the last; None for all that are trained, of a path for those between its
            first and last key.
        shows: One of PASSES.
        size: Width and height in pixels; None for that of the capture's pictures. Of "compare" each of the three.
        fps: Pictures per second of the video; None for as many as the capture has. What takes a second in the scene
            takes a second in the video, so that more pictures per second show moments between frames.
        speed: Of the scene; below 1 is slow motion.
        hold: Moment at which the scene stands still while the camera moves on; None for none.
        supersampling: Pictures are drawn so many times as large along both sides, and reduced.
        background: Behind the scene, red, green and blue in 0..255.
        is_transparent: Keep the opacity of the scene instead of putting a background behind it, which OpenEXR does in
            any case.
        sound: Name of the capture camera whose sound goes along; None for silence.
        features: Which features of the anchors are used, see engine.metrics.clips.features_apart.
        has_edits: Whether the edits of the project are applied.
    """

    out: Path
    format: str
    camera: str | None = None
    path: str | None = None
    turntable: Turntable | None = None
    frames: tuple[int, int] | None = None
    shows: PassName = "color"
    size: tuple[int, int] | None = None
    fps: float | None = None
    speed: float = 1.0
    hold: float | None = None
    supersampling: int = 1
    background: tuple[int, int, int] = (0, 0, 0)
    is_transparent: bool = False
    sound: str | None = None
    features: Features = "both"
    has_edits: bool = True

    def check(self) -> None:
        """See that it can be understood, whatever the project.

        Raises:
            ProjectError: An entry is out of its range, or two do not go together.
        """
        _check_numbers(self)
        kind = FORMATS[self.format]
        if sum(view is not None for view in (self.camera, self.path, self.turntable)) != 1:
            raise ProjectError(
                "Pictures are taken from a camera, along a path or on a turntable: give one of these three."
            )
        if self.is_transparent and not kind.can_be_transparent:
            others = ", ".join(name for name, other in FORMATS.items() if other.can_be_transparent)
            raise ProjectError(f"{kind.label} has no transparency.", hint=f"Formats that have it are {others}.")
        if self.is_transparent and self.shows != "color":
            raise ProjectError("Only pictures in colour can be transparent.", hint="Leave one of the two out.")
        if self.format == "exr" and self.background != (0, 0, 0):
            raise ProjectError(
                "OpenEXR files keep the opacity of the scene, so that nothing is behind it.",
                hint="Leave the background out.",
            )
        if self.sound is not None and kind.sound_codec is None:
            raise ProjectError(f"{kind.label} cannot hold sound.", hint="Write an mp4 or a webm file.")
        if self.shows == "compare" and (self.camera is None or self.hold is not None):
            raise ProjectError(
                "Side by side with the truth there is only what a camera of the capture took, frame by frame.",
                hint="Look through a camera, and leave the hold out.",
            )
        if self.shows == "compare" and self.size is not None:
            raise ProjectError(
                "Side by side, pictures have the size in which the camera took them.", hint="Leave the size out."
            )
        if self.shows == "compare" and self.format == "exr":
            raise ProjectError("Three pictures side by side hold no numbers for OpenEXR.", hint="Write PNG files.")


def _check_numbers(job: VideoJob) -> None:
    """Raises ProjectError where a number is out of its range."""
    if job.format not in FORMATS:
        raise ProjectError(f"'{job.format}' is not a format.", hint=f"Formats are {', '.join(FORMATS)}.")
    if job.shows not in PASSES:
        raise ProjectError(f"Pictures cannot show '{job.shows}'.", hint=f"They can show {', '.join(PASSES)}.")
    if not 1 <= job.supersampling <= MAX_SUPERSAMPLING:
        raise ProjectError(
            f"Supersampling is {job.supersampling}.", hint=f"Give a whole number from 1 to {MAX_SUPERSAMPLING}."
        )
    if job.size is not None and not all(side >= 1 for side in job.size):
        raise ProjectError(f"The size is {job.size[0]} x {job.size[1]}; a picture has at least one pixel.")
    for what, value, (low, high) in (("The rate", job.fps, FPS_RANGE), ("The speed", job.speed, SPEED_RANGE)):
        if value is not None and not low <= value <= high:  # not a number is not in the range either
            raise ProjectError(f"{what} is {value:g}.", hint=f"Give a number from {low:g} to {high:g}.")
    if not all(0 <= level <= 255 for level in job.background):
        raise ProjectError(f"The background is {job.background}.", hint="Give three numbers from 0 to 255.")
    if job.turntable is not None:
        _check_turntable(job.turntable)


def _check_turntable(turntable: Turntable) -> None:
    if not 0.0 < abs(turntable.n_turns) <= MAX_TURNS:
        raise ProjectError(
            f"A turntable of {turntable.n_turns:g} turns makes no sense.", hint=f"Give up to {MAX_TURNS}."
        )
    if not -90.0 <= turntable.elevation_deg <= 90.0:
        raise ProjectError(f"The elevation is {turntable.elevation_deg:g}.", hint="Give -90 to 90 degrees.")
    if turntable.radius is not None and not 0.0 < turntable.radius < math.inf:
        raise ProjectError(f"The radius is {turntable.radius:g}.", hint="Give a number above 0, in scene units.")
