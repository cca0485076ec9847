"""clipgstream synchronise: how far each camera is ahead and what says so; writes it into capture.json on request."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from app.background.kernels import use_threads
from app.cli.arguments import EXIT_OK, add_follow_links, path_argument
from app.cli.terminal.progress import ProgressLine
from app.training.service import Launch
from engine.capture.capture import ONE_PASS_CACHE_BYTES, Capture, open_capture
from engine.errors import CaptureError
from engine.progress import Progress
from engine.storage.json_files import json_text
from engine.synchronisation.synchronisation import Synchronisation
from engine.text import printable

SCHEMA = 1
MIN_CONFIDENCE = 0.5
"""Least confidence of shifts that are applied."""


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Arguments of `clipgstream synchronise`."""
    command.add_argument("path", type=path_argument, help="capture, or folder of plain videos without calibration")
    command.add_argument("--apply", action="store_true", help="write the offsets into capture.json")
    command.add_argument(
        "--out",
        type=path_argument,
        metavar="FOLDER",
        help="with --apply: write capture.json there, not into the capture",
    )
    command.add_argument(
        "--max-offset",
        type=float,
        default=1.0,
        metavar="SECONDS",
        help="largest offset that pictures are searched for (default: 1 second)",
    )
    command.add_argument("--json", action="store_true", help="print everything as JSON")
    add_follow_links(command)


def run(options: argparse.Namespace, launch: Launch) -> int:
    """clipgstream synchronise. Returns the exit code."""
    from engine.synchronisation.estimating import estimate_offsets
    from engine.synchronisation.recording import recordings_in_videos, recordings_of, videos_without_calibration

    use_threads(None, with_torch=False)
    capture: Capture | None = None
    videos = videos_without_calibration(options.path, follow_links=options.follow_links)
    if videos:
        recordings = recordings_in_videos(videos)
        fps, rig = 1 / float(np.median([np.median(np.diff(recording.times_s)) for recording in recordings])), None
    else:
        capture = open_capture(options.path, follow_links=options.follow_links, cache_bytes=ONE_PASS_CACHE_BYTES)
        capture.check_pictures()
        recordings, fps, rig = recordings_of(capture), capture.fps, capture.rig
    line = ProgressLine(is_quiet=options.json)

    def show(progress: Progress) -> None:
        line.update(progress.stage, progress.done, progress.message)

    found = estimate_offsets(recordings, fps=fps, rig=rig, max_offset_s=options.max_offset, report=show)
    line.finish()
    written = _apply(capture, found, options.out) if options.apply else None
    if options.json:
        print(json_text(synchronisation_document(found) | {"written": written and str(written)}, indent=2))
        return EXIT_OK
    for text in synchronisation_lines(found):
        print(text)
    if written is not None:
        print(f"Written to {printable(str(written))}.")
    elif not found.is_in_step and capture is not None:
        print("Nothing was changed. --apply writes the offsets into capture.json.")
    return EXIT_OK


def synchronisation_lines(found: Synchronisation) -> list[str]:
    """The findings, as a table and sentences."""
    width = max([len(printable(camera.name)) for camera in found.cameras] + [6])
    lines = [f"{'camera':>{width}}   offset, frames        ms  certain  by"]
    for camera in found.cameras:
        name = f"{printable(camera.name):>{width}}"
        if camera.source is None:
            lines.append(f"{name}   unknown")
            continue
        lines.append(
            f"{name}   {camera.offset_frames:+7.2f} ± {camera.sigma_frames:4.2f}  "
            f"{camera.offset_frames / found.fps * 1000:+8.1f}  {camera.confidence:6.0%}  {camera.source}"
        )
    lines += [f"{estimate.source}: {estimate.note}" for estimate in found.estimates]
    lines += [f"Disagreement: {printable(disagreement.text)}" for disagreement in found.disagreements]
    if not found.is_known:
        lines.append("The offset of some cameras is unknown: nothing links them to the others.")
    elif found.is_in_step:
        lines.append("All cameras are synchronised.")
    return lines


def synchronisation_document(found: Synchronisation) -> dict[str, object]:
    """The same as values for JSON."""

    def known(values: np.ndarray) -> list[float | None]:
        return [float(value) if np.isfinite(value) else None for value in values]

    return {
        "schema": SCHEMA,
        "fps": found.fps,
        "is_in_step": found.is_in_step,
        "cameras": [
            {
                "name": camera.name,
                "offset_frames": camera.offset_frames if camera.source else None,
                "sigma_frames": camera.sigma_frames if camera.source else None,
                "confidence": camera.confidence,
                "source": camera.source,
            }
            for camera in found.cameras
        ],
        "estimates": [
            {
                "source": estimate.source,
                "offsets_frames": known(estimate.offsets_frames),
                "sigmas_frames": known(estimate.sigmas_frames),
                "note": estimate.note,
            }
            for estimate in found.estimates
        ],
        "disagreements": [
            {
                "camera": found.cameras[disagreement.camera_index].name,
                "source": disagreement.source,
                "other": disagreement.other,
                "difference_frames": disagreement.difference_frames,
            }
            for disagreement in found.disagreements
        ],
    }


def _apply(capture: Capture | None, found: Synchronisation, out: Path | None) -> Path:
    """Write the offsets of the capture, those it had counted in.

    Raises:
        CaptureError: There is no calibration, or offsets are unknown or too uncertain.
    """
    from engine.capture.writers.capture_json import write_corrections
    from engine.synchronisation.applying import corrections_for

    if capture is None:
        raise CaptureError(
            "These videos have no calibration, so there is no capture yet to write offsets to.",
            hint="Calibrate first: clipgstream calibrate FOLDER --out CAPTURE; then synchronise CAPTURE --apply.",
        )
    unsure = [camera.name for camera in found.cameras if camera.source is None or camera.confidence < MIN_CONFIDENCE]
    if unsure:
        raise CaptureError(
            f"The offsets of {', '.join(unsure[:5])} are too uncertain to be written.",
            hint="See the table without --apply. Record a clap that all cameras hear or see, or set offset_frames in "
            "capture.json.",
            path=capture.path,
        )
    return write_corrections(capture.layout, capture.path, corrections_for(capture, found), target=out)
