"""How exactly offsets in time are found: error against the truth, apart from the zero that nobody can know.

    python -m tests.benchmarks.bench_synchronisation [CAPTURE ...] [--seeds 2]

Balls on uneven ways are painted for six cameras that are out of step, with whole frames and with parts of frames
between them. Captures that are in step are measured as they are, and with some cameras shifted by whole frames.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from engine.camera.rig import CameraRig
from engine.capture.capture import ONE_PASS_CACHE_BYTES, open_capture
from engine.synchronisation.estimating import estimate_offsets
from engine.synchronisation.recording import Recording, recordings_of
from tests.benchmarks.options import ending_on_bad_input
from tests.documents.table import table
from tests.engine.synchronisation.made_recordings import FPS, Pictures, made_recordings, ring

WHOLE = np.array([0.0, -7.0, 7.0, 2.0, -3.0, 4.0])
PARTS = np.array([0.0, -7.0, 7.0, 0.45, -2.7, 3.25])
MAX_SHIFT = 7
"""Frames; both ends of a capture are given up so that every camera has as many."""


def errors_of(recordings: list[Recording], truth: np.ndarray, fps: float, rig: CameraRig | None) -> tuple[str, ...]:
    """What says so, the largest error and the root mean square, in frames."""
    found = estimate_offsets(recordings, fps=fps, rig=rig)
    wrong = found.offsets_frames - truth
    wrong = wrong[np.isfinite(wrong)]
    wrong -= np.median(wrong)
    sources = ", ".join(sorted({camera.source for camera in found.cameras if camera.source is not None}))
    unknown = len(truth) - len(wrong)
    return (
        sources or "nothing",
        f"{np.abs(wrong).max():.2f}" if len(wrong) else "",
        f"{np.sqrt((wrong**2).mean()):.2f}" if len(wrong) else "",
        str(unknown),
    )


def shifted(recordings: list[Recording], offsets: np.ndarray, n_frames: int) -> list[Recording]:
    """Cameras of a capture that is in step, each later by so many frames."""
    moved = []
    for recording, offset in zip(recordings, offsets.astype(int).tolist(), strict=True):
        first = MAX_SHIFT - offset
        frames = np.stack(list(recording.source.read(range(first, first + n_frames))))
        moved.append(Recording(recording.name, Pictures(frames), recording.times_s[:n_frames]))
    return moved


def main() -> None:
    """Command line; see the module docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("captures", type=Path, nargs="*")
    parser.add_argument("--seeds", type=int, default=2, help="of the balls' ways")
    options = parser.parse_args()
    rig, rows = ring(len(PARTS)), []
    for seed in range(options.seeds):
        for what, offsets in (("whole frames", WHOLE), ("parts of frames", PARTS)):
            for with_rig in (True, False):
                made = made_recordings(rig, offsets, seed=seed)
                words = "" if with_rig else ", no calibration"
                title = f"balls, {len(offsets)} cameras, {what}, seed {seed}{words}"
                rows.append((title, *errors_of(made, offsets, FPS, rig if with_rig else None)))
    for path in options.captures:
        with ending_on_bad_input():
            capture = open_capture(path, cache_bytes=ONE_PASS_CACHE_BYTES)
            recordings, n_cameras = recordings_of(capture), len(capture.rig)
            in_step = errors_of(recordings, np.zeros(n_cameras), capture.fps, capture.rig)
            rows.append((f"{path.name}, {n_cameras} cameras in step", *in_step))
            n_frames = capture.n_frames - 2 * MAX_SHIFT
            if n_frames < 2:
                continue
            offsets = np.zeros(n_cameras)
            chosen = np.random.default_rng(0).permutation(n_cameras)[: n_cameras // 3]
            offsets[chosen] = np.random.default_rng(1).integers(-MAX_SHIFT, MAX_SHIFT + 1, len(chosen))
            moved = shifted(recordings, offsets, n_frames)
            title = f"{path.name}, {n_frames} frames, {len(chosen)} cameras shifted by up to {MAX_SHIFT}"
            rows.append((title, *errors_of(moved, offsets, capture.fps, capture.rig)))
    print(table(("capture", "by", "largest error, frames", "root mean square", "cameras not known"), rows))


if __name__ == "__main__":
    main()
