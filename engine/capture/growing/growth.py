"""Growth: how far a capture is that is being recorded, as values and in words."""

from __future__ import annotations

from dataclasses import dataclass

from engine.text import duration_text

MAX_NAMED = 3


@dataclass(frozen=True, slots=True)
class CameraGrowth:
    """How far one camera is.

    Attributes:
        name: Of the camera.
        n_complete: Frames in a row that are complete, or given up.
        n_behind: Frames that most cameras have and this one lacks.
        late_s: For how long it has lacked the first of them.
        has_later: Whether it lacks a frame and has later ones.
        fault: Why its next frame does not count; "" where nothing is there of it.
    """

    name: str
    n_complete: int
    n_behind: int = 0
    late_s: float = 0.0
    has_later: bool = False
    fault: str = ""

    @property
    def words(self) -> str:
        """What is late of it, to follow "camera"."""
        frame = f"frame {self.n_complete}"
        if self.has_later:
            return f"{self.name} has later frames but {f'of {frame} {self.fault}' if self.fault else f'no {frame}'}"
        n = f"{self.n_behind} frame{'s' if self.n_behind != 1 else ''}"
        return f"{self.name} is {n} behind{f' ({self.fault})' if self.fault else ''}"


@dataclass(frozen=True, slots=True)
class Growth:
    """How far all cameras are.

    Attributes:
        cameras: In the order of the capture.
        n_reached: Frames that most cameras have.
        idle_s: Seconds since any camera had a new frame.
        has_ended: Whether the folder says that the recording has ended.
        is_gone: Whether the folder cannot be found now.
    """

    cameras: tuple[CameraGrowth, ...]
    n_reached: int
    idle_s: float
    has_ended: bool = False
    is_gone: bool = False

    @property
    def n_complete(self) -> int:
        """Frames that are complete on all cameras."""
        return min(camera.n_complete for camera in self.cameras)

    @property
    def late(self) -> tuple[CameraGrowth, ...]:
        """Cameras that lack frames which most have, the one farthest behind first."""
        return tuple(sorted((one for one in self.cameras if one.n_behind), key=lambda one: -one.n_behind))

    def words(self, first: int, stop: int) -> str:
        """What frames [first, stop) wait for."""
        waiting = f"waiting for frames {first} to {stop - 1}"
        if self.is_gone:
            return f"{waiting}: the capture folder is gone"
        late = self.late
        if late:
            n_more = len(late) - MAX_NAMED
            named = ", ".join(camera.words for camera in late[:MAX_NAMED])
            more = f" and {n_more} more are behind" if n_more > 0 else ""
            return f"{waiting}: camera {named}{more}, for {duration_text(max(one.late_s for one in late))}"
        faults = [f"camera {camera.name}: {camera.fault}" for camera in self.cameras if camera.fault]
        if faults and self.idle_s > 1.0:
            return f"{waiting}: {faults[0]}"
        return f"{waiting}: {self.n_complete} are complete on all cameras"
