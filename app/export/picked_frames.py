"""PickedFrames: frames of an export, perhaps with gaps between them, without listing each."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import overload


@dataclass(frozen=True, slots=True)
class PickedFrames(Sequence[int]):
    """Rising frames; a value that can be compared, and sent to another process.

    Attributes:
        runs: Frames without gaps but for the step, none of them empty.
        step: Of every run, and of the first frames of all runs.
    """

    runs: tuple[range, ...]
    step: int = 1

    @staticmethod
    def of(frames: range) -> PickedFrames:
        """The same frames."""
        return PickedFrames((frames,) if frames else (), frames.step)

    def __repr__(self) -> str:
        """As a script would write it."""
        return repr(self.runs[0]) if len(self.runs) == 1 else f"PickedFrames({self.runs!r}, {self.step!r})"

    def __len__(self) -> int:
        return sum(len(run) for run in self.runs)

    def __iter__(self) -> Iterator[int]:
        return chain.from_iterable(self.runs)

    def __contains__(self, frame: object) -> bool:
        return any(frame in run for run in self.runs)

    @overload
    def __getitem__(self, index: int) -> int: ...

    @overload
    def __getitem__(self, index: slice) -> list[int]: ...

    def __getitem__(self, index: int | slice) -> int | list[int]:
        return list(self)[index]


def picked_frames(spans: Iterable[tuple[int, int]], step: int) -> PickedFrames:
    """Every so many of the frames from the first one on that lie in one of the spans.

    Args:
        spans: First frame and the one after the last, rising.
    """
    joined: list[tuple[int, int]] = []
    for start, stop in spans:
        if joined and joined[-1][1] == start:
            joined[-1] = (joined[-1][0], stop)
        else:
            joined.append((start, stop))
    if not joined:
        return PickedFrames(())
    first = joined[0][0]
    runs = tuple(run for start, stop in joined if (run := range(start + (first - start) % step, stop, step)))
    return PickedFrames(runs, step)


def frames_text(frames: PickedFrames) -> str:
    """Frames as the command line takes them, without their step: "A:B,C:D"."""
    return ",".join(f"{run.start}:{run.stop}" for run in frames.runs)
