"""Choices made by hand: a boundary, a camera, windows to cut out; checked before anything is measured or drawn."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from app.cli.arguments import parse_cameras
from app.project.project_facts import ProjectFacts
from engine.capture.capture import Capture
from engine.errors import ProjectError

_CROP = re.compile(
    r"(?P<camera>.+):(?P<frame>\d{1,9}):(?P<x>\d{1,9}),(?P<y>\d{1,9}),(?P<width>\d{1,9}),(?P<height>\d{1,9})", re.DOTALL
)


@dataclass(frozen=True, slots=True)
class InsetWindow:
    """A window in one picture. x, y: its upper left corner, working pixels."""

    camera: str
    frame_index: int
    x: int
    y: int
    width: int
    height: int

    @property
    def as_argument(self) -> str:
        """As --crop takes it."""
        return f"{self.camera}:{self.frame_index}:{self.x},{self.y},{self.width},{self.height}"


@dataclass(frozen=True, slots=True)
class FigureOptions:
    """Options of the command line; None and nothing where the figures choose by their rules.

    Attributes:
        boundary: First frame of a clip.
        camera: A name, or a number from 0.
        crops: CAMERA:FRAME:X,Y,WIDTH,HEIGHT each.
    """

    boundary: int | None = None
    camera: str | None = None
    crops: Sequence[str] = ()


@dataclass(frozen=True, slots=True)
class Places:
    """The same, checked: they exist."""

    boundary: int | None = None
    camera: str | None = None
    windows: Sequence[InsetWindow] = ()


def checked_places(wishes: FigureOptions, capture: Capture, projects: Sequence[ProjectFacts]) -> Places:
    """The chosen places, as places of a capture.

    Args:
        capture: Of the first project.
        projects: All that are compared, the page's own first.
    Raises:
        ProjectError: There is no such camera, no clip begins at that frame, or a window lies outside of the picture
            or of the trained frames.
    """
    camera = None if wishes.camera is None else _camera(wishes.camera, capture, "--camera")
    fingerprint = projects[0].settings.fingerprint
    borders = sorted(
        {frame for facts in projects if facts.settings.fingerprint == fingerprint for frame in borders_of(facts)}
    )
    if wishes.boundary is not None and wishes.boundary not in borders:
        shown = f"Clips meet at frame {', '.join(map(str, borders))}." if borders else "No two trained clips meet."
        raise ProjectError(f"--boundary is {wishes.boundary}, where no two trained clips meet.", hint=shown)
    return Places(wishes.boundary, camera, [_window(text, capture, projects[0]) for text in wishes.crops])


def borders_of(facts: ProjectFacts) -> list[int]:
    """First frames of trained clips that follow a trained one."""
    return [after.start for before, after in pairwise(facts.clips) if before.start + before.n_frames == after.start]


def _camera(text: str, capture: Capture, option: str) -> str:
    if text in capture.rig.names:
        return text
    found = parse_cameras(text, capture)
    if len(found) != 1:
        raise ProjectError(f"{option} is '{text}'; name one camera.")
    return found[0]


def _window(text: str, capture: Capture, own: ProjectFacts) -> InsetWindow:
    found = _CROP.fullmatch(text)
    if found is None:
        raise ProjectError(
            f"--crop is '{text}', which is not a window.", hint="Write CAMERA:FRAME:X,Y,WIDTH,HEIGHT, in pixels."
        )
    camera = _camera(found["camera"], capture, "--crop")
    frame, x, y, width, height = (int(found[name]) for name in ("frame", "x", "y", "width", "height"))
    if not any(clip.start <= frame < clip.start + clip.n_frames for clip in own.clips):
        raise ProjectError(
            f"--crop is '{text}', but frame {frame} is in no trained clip.", hint=f"Trained are {_spans(own)}."
        )
    n_across, n_down = (int(size) for size in capture.rig.image_sizes[capture.rig.names.index(camera)])
    if not (width and height and x + width <= n_across and y + height <= n_down):
        raise ProjectError(
            f"--crop is '{text}', which is empty or reaches outside of the picture.",
            hint=f"Pictures of camera {camera} are {n_across} x {n_down} pixels.",
        )
    return InsetWindow(camera, frame, x, y, width, height)


def _spans(facts: ProjectFacts) -> str:
    return "frames " + ", ".join(f"{clip.start} to {clip.start + clip.n_frames - 1}" for clip in facts.clips)
