"""ExportChoices: what a user chooses in the export dialog, as one value that is compared, sent and remembered."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from app.export.picked_frames import PickedFrames, picked_frames

FramesChoice = Literal["all", "range", "clip", "frame"]
FRAMES_CHOICES: tuple[FramesChoice, ...] = ("all", "range", "clip", "frame")
STEP, MAX_STEP = "step", 100_000
"""The answer that says which frames are left out, and the most of it."""
Word = Annotated[str, Meta(max_length=400)]


class ExportChoices(msgspec.Struct, frozen=True):
    """The value.

    Attributes:
        kind: One of the kinds of app.export.queue.export_jobs.
        answers: Chosen values by "kind.option", of every kind that was looked at.
        frames: All that are trained, those from in to out of the timeline, this clip, or this frame.
        out: The file or folder that is written; empty to have one suggested.
    """

    kind: Word = "gaussians"
    answers: tuple[tuple[Word, Word], ...] = ()
    frames: FramesChoice = "all"
    out: str = ""

    @property
    def step(self) -> int:
        """Every so many frames; of the present kind alone, as other kinds would carry it along unseen."""
        said = self.answer(STEP)
        return min(max(int(said), 1), MAX_STEP) if said.isdecimal() else 1

    def with_step(self, step: int) -> ExportChoices:
        """The same with one of every so many frames."""
        return self.with_answer(STEP, str(min(max(step, 1), MAX_STEP)))

    def answer(self, option: str, usual: str = "") -> str:
        """The value chosen for an option of the present kind."""
        return dict(self.answers).get(f"{self.kind}.{option}", usual)

    def with_answer(self, option: str, value: str) -> ExportChoices:
        """The same with another answer."""
        answers = {**dict(self.answers), f"{self.kind}.{option}": value}
        return msgspec.structs.replace(self, answers=tuple(answers.items()))

    def changed(self, **values: object) -> ExportChoices:
        """The same with other values."""
        return msgspec.structs.replace(self, **values)


class ExportContext(msgspec.Struct, frozen=True):
    """The facts that choices depend on: plain values of the open project.

    Attributes:
        name: Of the project, as the user knows it.
        n_frames: Of the capture, as far as it is worked on.
        clips: First frame and the one after the last, of every clip.
        trained: Which of them are finished.
        frame_index: Frame under the playhead.
        in_frame, out_frame: Of the timeline, both included.
        cameras: Names.
        paths: Names of the project's camera paths.
        has_edits: Whether the project has edits that are on.
        has_timing: Whether the take is edited in time.
        has_videos: Whether some camera has a video, which may have sound.
        picture_size: Width and height of a capture camera's picture.
        fps: Frames per second.
    """

    name: str
    n_frames: int
    clips: tuple[tuple[int, int], ...]
    trained: tuple[int, ...]
    frame_index: int
    in_frame: int
    out_frame: int
    cameras: tuple[str, ...]
    picture_size: tuple[int, int]
    fps: float
    paths: tuple[str, ...] = ()
    has_videos: bool = False
    has_edits: bool = False
    has_timing: bool = False

    def frames(self, choice: FramesChoice, step: int) -> PickedFrames:
        """The frames of a choice; none where there are none. Those of "all" are trained and may have gaps."""
        if choice == "range":
            return PickedFrames.of(range(self.in_frame, self.out_frame + 1, step))
        if choice == "frame":
            return PickedFrames.of(range(self.frame_index, self.frame_index + 1))
        if choice == "clip":
            found = [span for span in self.clips if span[0] <= self.frame_index < span[1]]
        else:
            found = [self.clips[index] for index in sorted(self.trained)]
        return picked_frames(found, step)

    def untrained(self, frames: Sequence[int]) -> list[tuple[int, int]]:
        """First and last frames of the runs of clips that are not trained and that some of the frames lie in."""
        runs: list[tuple[int, int]] = []
        for index, (start, stop) in enumerate(self.clips):
            if index in self.trained or not any(frame in frames for frame in range(start, stop)):
                continue
            if runs and runs[-1][1] == start - 1:
                runs[-1] = (runs[-1][0], stop - 1)
            else:
                runs.append((start, stop - 1))
        return runs
