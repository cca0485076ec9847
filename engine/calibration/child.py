"""The process that calibrates.

Never imported by the program: pycolmap must stay out of its processes.
"""

from __future__ import annotations

import shutil
import threading
import zlib  # noqa: F401  must be loaded before pycolmap, whose own zlib symbols otherwise replace it
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from engine.calibration.boards.calibrating import BoardProgress, calibrate_by_board
from engine.calibration.calibrate import CalibrationJob, least_cameras
from engine.calibration.calibrated import Calibration
from engine.calibration.finishing import finished
from engine.calibration.matching.feature_processes import key_points as looked_for
from engine.calibration.matching.matching import KeyPoints, Pair, all_pairs, match_all
from engine.calibration.matching.motions import agreed_motions
from engine.calibration.matching.pictures import N_MOMENTS, matching_size, read_pictures
from engine.calibration.options import CalibrationOptions
from engine.calibration.pair_lines import WHAT_TO_DO, PairCounts, pair_lines
from engine.calibration.solving.agreement import MatchAgreement, agreement
from engine.calibration.solving.links import is_held, linked_estimate, linked_pairs
from engine.calibration.solving.mapping import FirstEstimate, focals_to_try, map_cameras, verified_matches
from engine.calibration.solving.solving import FINE, ROUGH, CalibrationSolution, solve
from engine.calibration.videos import PlainVideo, common_length, find_videos
from engine.children.child import Parent
from engine.errors import PreparationError
from engine.parallel import map_ordered
from engine.progress import Progress, ReportProgress

READING = 0.1
"""Share of the time of a camera's key points that reading its frames takes."""
MATCHING = 0.7
"""Share of the time of matching that looks take; the rest tells which matches one motion fits."""
FIRST_LOOK = 0.7
"""Share of the time of a calibration that finds cameras near each other; of others it is about half."""
N_FAR_MOMENTS = 30
"""For cameras far apart."""
N_SEEDS = 3
"""Random numbers with which every focal length is tried: repeating patterns lead single trials astray."""
N_TRIED_ON = 3
"""Of these first estimates, those that explain most matches are adjusted before one is chosen."""


def main(job: CalibrationJob, parent: Parent[Progress]) -> Calibration:
    """Runs in the child."""
    board = job.options.board
    videos = find_videos(job.folder, follow_links=job.follow_links, least=least_cameras(job.options))
    if board is not None:
        progress = StageProgress(parent.report, BOARD_STAGES)
        looked = progress.count("Looking for the board", len(videos), "cameras")
        told = BoardProgress(looked, lambda share: progress.reach("Adjusting", share))
        return calibrate_by_board(videos, board, job.options, told)
    scratch = job.scratch / "mapping"

    def first(progress: Progress) -> None:
        parent.report(replace(progress, done=FIRST_LOOK * progress.done))

    def second(progress: Progress) -> None:
        parent.report(replace(progress, done=FIRST_LOOK + (1 - FIRST_LOOK) * progress.done))

    try:
        found = calibrate_here(videos, job.options, scratch, StageProgress(first))
    except PreparationError:
        far = calibrate_far(videos, job.options, StageProgress(second, FAR_STAGES))
        if far is None or far.failure:
            raise
        return far
    if not found.failure:
        return found
    far = calibrate_far(videos, job.options, StageProgress(second, FAR_STAGES))
    return found if far is None or far.failure else far


def calibrate_here(
    videos: list[PlainVideo], options: CalibrationOptions, scratch: Path, progress: StageProgress
) -> Calibration:
    """All of it in this process, for cameras that are near each other."""
    key_points = _key_points(videos, progress)
    sizes = np.array([matching_size(video.size) for video in videos])
    matches = match_all(
        key_points, progress.count("Matching", len(all_pairs(len(videos))), "pairs of cameras", last=MATCHING)
    )
    shutil.rmtree(scratch, ignore_errors=True)
    scratch.mkdir()
    verified = verified_matches(scratch, key_points, matches, sizes, options.lens)
    solution = _best_solution(scratch, key_points, matches, verified, sizes, options, progress)
    if solution is None:
        names = [video.name for video in videos]
        pairs = [PairCounts(names[a], names[b], len(rows)) for (a, b), rows in verified.items()]
        table = "\n".join(pair_lines(pairs))
        raise PreparationError(
            f"No three cameras could be placed. Matches that fit one motion:\n{table}\n", hint=WHAT_TO_DO
        )
    return finished(solution, videos, key_points, verified, sizes, options)


def calibrate_far(videos: list[PlainVideo], options: CalibrationOptions, progress: StageProgress) -> Calibration | None:
    """For cameras that are far apart, joined pair by pair: more moments, looked at closer. None where nothing moves, or
    nothing can be joined."""
    key_points = _key_points(videos, progress, n_moments=N_FAR_MOMENTS, is_thorough=True)
    if not any((points.moments > 0).any() for points in key_points):
        return None
    sizes = np.array([matching_size(video.size) for video in videos])
    n_pairs = len(all_pairs(len(videos)))
    matches = match_all(key_points, progress.count("Matching", n_pairs, "pairs of cameras", last=0.5))
    motions = agreed_motions(
        key_points, matches, sizes, progress.count("Matching", n_pairs, "pairs of cameras", first=0.5)
    )
    chosen = {"lens": options.lens, "is_shared": options.is_lens_shared}
    best: tuple[tuple[int, float], CalibrationSolution, dict[Pair, np.ndarray]] | None = None
    focals = focals_to_try(options.lens)
    for number, focal in enumerate(focals):
        progress.reach("Adjusting", number / (len(focals) + 1))
        geometries, tree = linked_pairs(motions, key_points, sizes, focal)
        estimate = linked_estimate(geometries, tree, key_points, sizes, focal)
        if estimate is None:
            continue
        trusted = {pair: motions[pair].rows if pair in geometries else rows[:0] for pair, rows in matches.items()}
        solution = solve(estimate, key_points, trusted, sizes, stages=ROUGH, **chosen)
        if not len(solution.tracks.points):
            continue
        agreed = agreement(solution.rows, solution.cameras, key_points, trusted, float(sizes.max()))
        share = float(agreed.n_explained.sum() / max(agreed.n_matches.sum(), 1))
        worth = int(is_held(agreed, solution.tracks).sum()), share
        if best is None or worth > best[0]:
            best = worth, solution, trusted
    if best is None:
        return None
    _, rough, trusted = best
    progress.reach("Adjusting", len(focals) / (len(focals) + 1))
    estimate = FirstEstimate(rough.rows, rough.cameras, rough.are_alike)
    solution = solve(estimate, key_points, trusted, sizes, stages=FINE, **chosen)
    if not len(solution.tracks.points):
        return None
    return finished(solution, videos, key_points, trusted, sizes, options, is_far=True)


def _key_points(
    videos: list[PlainVideo], progress: StageProgress, *, n_moments: int = N_MOMENTS, is_thorough: bool = False
) -> list[KeyPoints]:
    n_frames = common_length(videos)
    of_cameras = progress.count("Key points", len(videos), "cameras")

    def one(row: int) -> KeyPoints:
        pictures = read_pictures(
            videos[row], n_frames, n_moments=n_moments, advance=lambda share: of_cameras(READING * share)
        )
        videos[row].source.close()
        return looked_for(
            pictures, videos[row].name, lambda share: of_cameras((1 - READING) * share), is_thorough=is_thorough
        )

    return map_ordered(one, range(len(videos)))


def _best_solution(
    scratch, key_points, matches, verified, sizes, options: CalibrationOptions, progress: StageProgress
) -> CalibrationSolution | None:
    """Of many starts, alike and unlike, the one that explains most of the verified matches."""

    def judged(one: FirstEstimate | CalibrationSolution) -> MatchAgreement:
        return agreement(one.rows, one.cameras, key_points, verified, float(sizes.max()))

    def worth(one: FirstEstimate | CalibrationSolution) -> int:
        return int(judged(one).n_explained.sum()) // 2

    def is_clean(one: FirstEstimate | CalibrationSolution) -> bool:
        return len(one.rows) == len(sizes) and bool(judged(one).is_plausible.all())

    focals = focals_to_try(options.lens)
    starts = [(focal, True, seed) for seed in range(N_SEEDS) for focal in focals]
    starts.insert(len(focals), (focals[0], False, 0))  # cameras may be unlike, too
    estimates: list[FirstEstimate] = []
    for number, (focal, are_alike, seed) in enumerate(starts):
        if seed and any(is_clean(estimate) for estimate in estimates):
            break

        def placed(share: float, number: int = number) -> None:
            progress.reach("Mapping", (number + share) / len(starts), f"start {number + 1} of {len(starts)}")

        placed(0.0)
        estimates += map_cameras(
            scratch, sizes, options.lens, focal=focal, are_alike=are_alike, seed=seed, progress=placed
        )[:1]
    estimates.sort(key=worth, reverse=True)
    chosen = {"lens": options.lens, "is_shared": options.is_lens_shared}
    best: CalibrationSolution | None = None
    for number, estimate in enumerate(estimates[:N_TRIED_ON]):

        def adjusted(share: float, number: int = number) -> None:
            progress.reach("Adjusting", 0.5 * (number + share) / N_TRIED_ON)

        adjusted(0.0)
        solution = solve(estimate, key_points, matches, sizes, stages=ROUGH, progress=adjusted, **chosen)
        if len(solution.tracks.points) and (best is None or worth(solution) > worth(best)):
            best = solution
        if best is not None and is_clean(best):
            break
    if best is None:
        return None
    rough = FirstEstimate(best.rows, best.cameras, best.are_alike)

    def finely(share: float) -> None:
        progress.reach("Adjusting", 0.5 + 0.5 * share)

    return solve(rough, key_points, matches, sizes, stages=FINE, progress=finely, **chosen)


FAR_STAGES = {"Key points": 0.6, "Matching": 0.2, "Adjusting": 0.2}
BOARD_STAGES = {"Looking for the board": 0.7, "Adjusting": 0.3}
STAGES = {"Key points": 0.45, "Matching": 0.15, "Mapping": 0.2, "Adjusting": 0.2}
"""Stages and their shares of the time."""


class StageProgress:
    """The share done, over all stages.

    Args:
        report: Called at every step, one at a time.
        stages: Their shares of the time, in order.
    """

    def __init__(self, report: ReportProgress, stages: Mapping[str, float] = MappingProxyType(STAGES)) -> None:
        self._report, self._stages, self._lock, self._done = report, stages, threading.Lock(), 0.0

    def reach(self, stage: str, share: float, message: str = "") -> None:
        """So much of a stage is done, 0..1."""
        names = list(self._stages)
        before = sum(self._stages[name] for name in names[: names.index(stage)])
        with self._lock:
            self._done = max(self._done, before + share * self._stages[stage])
            self._report(Progress(stage, self._done, message))

    def count(self, stage: str, n: int, what: str, *, first: float = 0.0, last: float = 1.0) -> Callable[[float], None]:
        """For threads that work on n things each: a function to call with the share of one thing done since.

        Args:
            stage: Its name.
            n: How many there are.
            what: Their name, as "cameras".
            first, last: Shares of the stage at the beginning and at the end.
        """
        lock, done = threading.Lock(), 0.0

        def advance(share: float) -> None:
            nonlocal done
            with lock:
                done += share
                counted = f"{int(done + 1e-6)} of {n} {what}"
                self.reach(stage, first + (last - first) * min(done / n, 1.0), counted)

        advance(0.0)
        return advance
