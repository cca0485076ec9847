"""The process that calibrates: `python -m engine.calibration.child JOB.json RESULT.npz BEAT`.

Never imported by the program: pycolmap must stay out of its processes.
"""

from __future__ import annotations

import json
import shutil
import zlib  # noqa: F401  must be loaded before pycolmap, whose own zlib symbols otherwise replace it
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from engine.calibration.agreement import Agreement, agreement
from engine.calibration.features import extract
from engine.calibration.finishing import finished
from engine.calibration.mapping import FirstEstimate, focals_to_try, map_cameras, verified_matches
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
N_SEEDS = 3
"""Random numbers with which every focal length is tried: repeating patterns lead single trials astray."""
N_TRIED_ON = 3
"""Of these first estimates, those that explain most matches are adjusted before one is chosen."""


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
    solution = _best_solution(scratch, key_points, matches, verified, sizes, options, teller)
    if solution is None:
        n_pairs = sum(len(rows) >= 30 for rows in verified.values())
        raise PreparationError(
            f"No three cameras could be placed: {n_pairs} of {len(verified)} pairs of cameras have 30 matches or more "
            "that fit one motion.",
            hint="Neighbouring cameras have to see the same things from directions less than about 25 degrees apart, "
            "with fine, irregular patterns on them. See docs/calibration.md for what to film.",
        )
    return finished(solution, videos, key_points, verified, sizes, options)


def _best_solution(
    scratch, key_points, matches, verified, sizes, options: CalibrationOptions, teller: Teller
) -> Solution | None:
    """Of many starts, alike and unlike, the one that explains most of the verified matches."""

    def judged(one: FirstEstimate | Solution) -> Agreement:
        return agreement(one.rows, one.cameras, key_points, verified, float(sizes.max()))

    def worth(one: FirstEstimate | Solution) -> int:
        return int(judged(one).n_explained.sum())

    def is_clean(one: FirstEstimate | Solution) -> bool:
        return len(one.rows) == len(sizes) and not judged(one).is_doubtful.any()

    focals = focals_to_try(options.lens)
    starts = [(focal, True, seed) for seed in range(N_SEEDS) for focal in focals]
    starts.insert(len(focals), (focals[0], False, 0))  # cameras may be unlike, too
    estimates: list[FirstEstimate] = []
    for number, (focal, are_alike, seed) in enumerate(starts):
        if seed and any(is_clean(estimate) for estimate in estimates):
            break
        teller.tell("Mapping", number / len(starts))
        estimates += map_cameras(scratch, sizes, options.lens, focal=focal, are_alike=are_alike, seed=seed)[:1]
    estimates.sort(key=worth, reverse=True)
    chosen = {"lens": options.lens, "is_shared": options.is_lens_shared}
    best: Solution | None = None
    for number, estimate in enumerate(estimates[:N_TRIED_ON]):
        teller.tell("Adjusting", 0.5 * number / N_TRIED_ON)
        solution = solve(estimate, key_points, matches, sizes, stages=ROUGH, **chosen)
        if len(solution.tracks.points) and (best is None or worth(solution) > worth(best)):
            best = solution
        if best is not None and is_clean(best):
            break
    if best is None:
        return None
    rough = FirstEstimate(best.rows, best.cameras, best.are_alike)

    def tell(done: float) -> None:
        teller.tell("Adjusting", 0.5 + 0.5 * done)

    return solve(rough, key_points, matches, sizes, stages=FINE, progress=tell, **chosen)


if __name__ == "__main__":
    serve(main)
