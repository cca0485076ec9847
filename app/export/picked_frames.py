"""PickedFrames: frames with gaps between them, every so many of them, told without listing each."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import overload


@dataclass(frozen=True, slots=True)
class PickedFrames(Sequence[int]):
    """Rising frames; a value that can be pickled and compared.

    Attributes:
        runs: Frames without gaps but for the step, none of them empty.
        step: Of every run, and of the first frames of all runs.
    """

    runs: tuple[range, ...]
    step: int = 1

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


def picked_frames(spans: Iterable[tuple[int, int]], step: int) -> range | PickedFrames:
    """Every so many of the frames from the first one on that lie in one of the spans; a range where there is no gap.

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
        return range(0)
    first = joined[0][0]
    runs = tuple(run for start, stop in joined if (run := range(start + (first - start) % step, stop, step)))
    return runs[0] if len(runs) == 1 else PickedFrames(runs, step)


def frames_text(frames: range | PickedFrames) -> str:
    """Frames as the command line takes them, without their step: "A:B,C:D"."""
    runs = frames.runs if isinstance(frames, PickedFrames) else (frames,)
    return ",".join(f"{run.start}:{run.stop}" for run in runs)
