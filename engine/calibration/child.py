"""The process that calibrates: `python -m engine.calibration.child JOB.json RESULT.npz BEAT`.

Never imported by the program: pycolmap must stay out of its processes.
"""

from __future__ import annotations

import json
import shutil
import zlib  # noqa: F401  must be loaded before pycolmap, whose own zlib symbols otherwise replace it
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from engine.calibration.features import extract
from engine.calibration.finishing import finished
from engine.calibration.mapping import FirstEstimate, map_cameras, verified_matches
from engine.calibration.matching import KeyPoints, match_all
from engine.calibration.options import CalibrationOptions
from engine.calibration.pictures import matching_size, read_pictures
from engine.calibration.solving import FINE, ROUGH, Solution, solve
from engine.calibration.videos import common_length, find_videos
from engine.children.child import serve
from engine.errors import CaptureError, EngineError, PreparationError
from engine.parallel import map_ordered

STAGES = {"Key points": 0.45, "Matching": 0.15, "Mapping": 0.2, "Adjusting": 0.2}
"""Stages and their shares of the time."""
N_STARTS = 3
"""Times that mapping begins anew, from other random numbers: repeating patterns lead single ones astray."""


class Teller:
    """Leaves progress beside the job, for the parent to read."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def tell(self, stage: str, done: float, message: str = "") -> None:
        """Share `done` of a stage."""
        names = list(STAGES)
        before = sum(STAGES[name] for name in names[: names.index(stage)])
        document = {"stage": stage, "done": before + done * STAGES[stage], "message": message}
        unfinished = self._path.with_name("progress.partial")
        with suppress(OSError):
            unfinished.write_text(json.dumps(document))
            unfinished.replace(self._path)


def main(job: Path, result: Path) -> None:
    """Calibrate what the job names; leave cameras, or what was wrong."""
    request = json.loads(job.read_bytes())
    options = msgspec.convert(request["options"], CalibrationOptions)
    try:
        arrays, document = calibrate_here(
            Path(request["folder"]), options, job.with_name("mapping"), Teller(job.with_name("progress.json"))
        )
    except EngineError as error:
        message, hint = (str(error), "") if getattr(error, "problems", ()) else (error.message, error.hint)
        arrays: dict[str, np.ndarray] = {}
        document = {"error": message, "hint": hint, "is_bad_input": isinstance(error, CaptureError)}
    unfinished = result.with_name("partial.npz")
    np.savez(unfinished, document=np.array(json.dumps(document)), **arrays)  # type: ignore[arg-type]
    unfinished.replace(result)


def calibrate_here(
    folder: Path, options: CalibrationOptions, scratch: Path, teller: Teller
) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """All of it in this process: arrays and the document that engine.calibration.calibrate reads."""
    videos = find_videos(folder)
    n_frames, n_done = common_length(videos), 0

    def one(row: int) -> KeyPoints:
        nonlocal n_done
        points = extract(read_pictures(videos[row], n_frames))
        videos[row].source.close()
        n_done += 1
        teller.tell("Key points", n_done / len(videos), f"{n_done} of {len(videos)} cameras")
        return points

    teller.tell("Key points", 0.0)
    key_points = map_ordered(one, range(len(videos)))
    sizes = np.array([matching_size(video.size) for video in videos])
    teller.tell("Matching", 0.0)
    matches = match_all(key_points)
    shutil.rmtree(scratch, ignore_errors=True)
    scratch.mkdir()
    verified = verified_matches(scratch, key_points, matches, sizes, options.lens)
    solution = _best_solution(scratch, key_points, matches, sizes, options, teller)
    if solution is None:
        n_pairs = sum(len(rows) >= 30 for rows in verified.values())
        raise PreparationError(
            f"No three cameras could be placed: {n_pairs} of {len(verified)} pairs of cameras have 30 matches or more "
            "that fit one motion.",
            hint="Neighbouring cameras have to see the same things from directions less than about 25 degrees apart, "
            "with fine, irregular patterns on them. See docs/calibration.md for what to film.",
        )
    return finished(solution, videos, key_points, verified, sizes, options)


def _best_solution(scratch, key_points, matches, sizes, options: CalibrationOptions, teller: Teller) -> Solution | None:
    """Of several starts the one that places most cameras; of those the one with most sightings that fit."""
    best: Solution | None = None
    chosen = {"lens": options.lens, "is_shared": options.is_lens_shared}
    for start in range(N_STARTS):
        teller.tell("Mapping", start / N_STARTS)
        found = map_cameras(scratch, len(sizes), options.lens, seed=start)
        if not found:
            continue
        solution = solve(found[0], key_points, matches, sizes, stages=ROUGH, **chosen)
        if len(solution.tracks.points) and (best is None or _worth(solution) > _worth(best)):
            best = solution
    if best is None:
        return None
    teller.tell("Adjusting", 0.0)
    rough = FirstEstimate(best.rows, best.cameras)
    tell = partial(teller.tell, "Adjusting")
    return solve(rough, key_points, matches, sizes, stages=FINE, progress=tell, **chosen)


def _worth(solution: Solution) -> tuple[int, int]:
    return len(solution.rows), len(solution.tracks.seen)


if __name__ == "__main__":
    serve(main)
