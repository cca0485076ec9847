"""Which files an export of Gaussians writes: their names, and the frame and part in each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from app.export.jobs.gaussians import WrittenPart
from app.export.scene_frames import Part

SIDECAR = "_export.json"
"""End of the name of the file that describes the others."""
_N_DIGITS = 4
_MAX_NAME_BYTES = 120
"""Of a project's name in the name of a file: the rest has to fit too."""


@dataclass(frozen=True, slots=True)
class GaussianFile:
    """One file to write: a part of the scene at a frame, of the capture or the take. What stands still is that of the
    frame's clip, with the edits that hold then."""

    name: str
    frame: int
    part: Part


def base_name(name: str) -> str:
    """The beginning of all names, of the name of a project; shortened where that is very long."""
    short = name.encode("utf-8", "ignore")[:_MAX_NAME_BYTES].decode("utf-8", "ignore").strip(". ")
    return short or "scene"


def moment_files(name: str, suffix: str, frames: Sequence[int], part: WrittenPart, n_frames: int) -> list[GaussianFile]:
    """A file per frame: numbered as the frames are, without a number where there is only one.

    Args:
        n_frames: Of the capture or the take; all numbers have as many digits as its last one, at least four.
    """
    if part == "static":
        return []
    stem = name if part == "all" else f"{name}_moving"
    kept: Part = "all" if part == "all" else "moving"
    if len(frames) == 1:
        return [GaussianFile(f"{stem}{suffix}", frames[0], kept)]
    return [GaussianFile(f"{stem}_{_number(frame, n_frames)}{suffix}", frame, kept) for frame in frames]


def static_file(name: str, suffix: str, frame: int | None, n_frames: int) -> GaussianFile:
    """The file of still parts from a frame on; of None, where they are the same in all frames, without a number."""
    end = "" if frame is None else f"_{_number(frame, n_frames)}"
    return GaussianFile(f"{name}_static{end}{suffix}", frame or 0, "static")


def _number(frame: int, n_frames: int) -> str:
    """With zeros in front, so that names sort as frames do."""
    return f"{frame:0{max(_N_DIGITS, len(str(n_frames - 1)))}d}"
