"""Records a capture anew: copies its images into another folder, frame by frame, as cameras would write them.

    python -m tests.faults.record CAPTURE FOLDER --fps 5 --late 3:4 --lost 7:12

Every image is written in two pieces. `--late CAMERA:N` is N frames behind, `--lost CAMERA:FRAME` never comes, and
`--torn CAMERA:FRAME` stays half-written. The first frames and the calibration are there at once.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from engine.capture.capture import Capture, open_capture
from engine.capture.frames import ImageFrames

N_AT_ONCE = 2


class Recorder:
    """Writes images of a capture below another folder.

    Args:
        source: A capture of images.
        folder: Made here.
        late: How many frames a camera is behind.
        lost, torn: (camera, frame) that never come, or stay half-written.
    """

    def __init__(
        self,
        source: Capture,
        folder: Path,
        *,
        late: dict[str, int] | None = None,
        lost: Sequence[tuple[str, int]] = (),
        torn: Sequence[tuple[str, int]] = (),
    ) -> None:
        self.source, self.folder = source, folder
        self._late, self._lost, self._torn = dict(late or {}), set(lost), set(torn)
        folder.mkdir(parents=True, exist_ok=True)
        for path in source.path.iterdir():
            if path.is_file():
                shutil.copyfile(path, folder / path.name)

    def write(self, tick: int, *, between: Callable[[], object] = lambda: None) -> None:
        """Write what cameras deliver at one moment. between: Called while their images are half-written."""
        due = []
        for camera in self.source.layout.cameras:
            frame = tick - self._late.get(camera.name, 0)
            if 0 <= frame < self.source.n_frames and (camera.name, frame) not in self._lost:
                due.append((camera.name, frame, *self._paths(camera.source, frame)))
        for _, _, source, target in due:
            target.parent.mkdir(parents=True, exist_ok=True)
            data = source.read_bytes()
            target.write_bytes(data[: len(data) // 2])
        between()
        for name, frame, source, target in due:
            if (name, frame) not in self._torn:
                target.write_bytes(source.read_bytes())

    def _paths(self, frames: object, frame: int) -> tuple[Path, Path]:
        assert isinstance(frames, ImageFrames)
        source = frames.files[frame]
        return source, self.folder / source.relative_to(self.source.path)

    @property
    def n_ticks(self) -> int:
        """Moments until the last camera is done."""
        return self.source.n_frames + max(self._late.values(), default=0)


def main(arguments: Sequence[str] | None = None) -> int:
    """Record at some rate, then write the file that ends the recording."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("source", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--fps", type=float, default=5.0)
    for name in ("late", "lost", "torn"):
        parser.add_argument(f"--{name}", action="append", default=[], type=_pair)
    options = parser.parse_args(arguments)
    recorder = Recorder(
        open_capture(options.source), options.folder, late=dict(options.late), lost=options.lost, torn=options.torn
    )
    for tick in range(recorder.n_ticks):
        began_s = time.monotonic()
        pause_s = 0.5 / options.fps if tick >= N_AT_ONCE else 0.0
        recorder.write(tick, between=lambda: time.sleep(pause_s))  # noqa: B023
        print(f"{time.time():.3f} frame {tick}", flush=True)
        time.sleep(max(began_s + 2 * pause_s - time.monotonic(), 0.0))
    (options.folder / "END").touch()
    return 0


def _pair(text: str) -> tuple[str, int]:
    name, _, number = text.partition(":")
    return name, int(number)


if __name__ == "__main__":
    sys.exit(main())
