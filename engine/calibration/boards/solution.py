"""All cameras and all places of a board together, and what speaks against each camera."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from engine.calibration.boards.detection import BoardView
from engine.calibration.boards.joining import MIN_COMMON, Pose, joined
from engine.calibration.boards.single import EXPECTED, SingleCamera, lens_of, pose_of, refined, sightings
from engine.calibration.solving.bundle import Observations, RigidPlaces, adjust, errors_px
from engine.calibration.solving.cameras import N_LENS, Cameras, with_lens
from engine.capture.layout.format_checks import shortened

MIN_VIEWS = 6
"""Of one camera; fewer do not give its lens."""
RIGID_PX = 2.5
"""At a width of 1,000 pixels. A view whose corners miss a flat board of the given squares by more is not one."""
REACH_PX = 4.0
"""At a width of 1,000 pixels, that corners may be off in the end."""
N_ITERATIONS = 30
N_MORE = N_LENS["opencv"] - N_LENS["simple"]
SYNCHRONOUS = 2.0
"""Lenses are adjusted to all cameras together where corners then miss by at most so many times what they miss in each
alone. Where pictures are not of the same moments, they would be bent to make up for it."""


@dataclass(frozen=True, slots=True)
class BoardSolution:
    """What was found.

    Attributes:
        rows: Which cameras, rising. [R]
        cameras: In this order; pixels of their pictures.
        places: Of the board, one per moment in which two cameras saw it.
        moments: The number of the moment of each place. [B]
        seen: All sightings of corners in these, also wrong ones.
        errors: Of each, px; infinite behind a camera. [N]
        own_errors_px: Median of each camera's errors where nobody else has a say. [R]
        n_views: Views of each camera, all cameras. [C]
        n_common: Moments in which two cameras agree about the board. [C, C]
        unusable: Why a camera takes no part, by camera.
    """

    rows: np.ndarray
    cameras: Cameras
    places: RigidPlaces
    moments: np.ndarray
    seen: Observations
    errors: np.ndarray
    own_errors_px: np.ndarray
    n_views: np.ndarray
    n_common: np.ndarray
    unusable: Mapping[int, str]


def solve_boards(
    views: Sequence[Mapping[int, BoardView]],
    corners: np.ndarray,
    sizes: np.ndarray,
    lens: str,
    progress: Callable[[float], None] = lambda _: None,
) -> BoardSolution | str:
    """Cameras from views of a board.

    Args:
        views: Of each moment, by camera.
        corners: Of the board, m. [K, 3]
        sizes: Width and height of each camera's pictures. [C, 2]
        lens: "fisheye"; anything else takes one number or four, whichever the views ask for.
        progress: Called with the share that is done.
    Returns:
        The solution, in metres, or why there is none.
    """
    n_cameras = len(sizes)
    own = [[moment[row] for moment in views if row in moment] for row in range(n_cameras)]
    n_views = np.array([len(each) for each in own])
    singles: dict[int, SingleCamera] = {}
    unusable: dict[int, str] = {}
    for row in range(n_cameras):
        single = lens_of(own[row], corners, _size(sizes, row), _first_lens(lens)) if n_views[row] >= MIN_VIEWS else None
        if n_views[row] < MIN_VIEWS:
            unusable[row] = f"the board was found in {n_views[row]} pictures of it; {MIN_VIEWS} are needed"
        elif single is None or single.error_px > RIGID_PX * sizes[row].max() / 1000:
            off = "far" if single is None else f"{single.error_px:.1f} px"
            unusable[row] = (
                f"corners lie {off} from where a flat board of this kind can have them; check the numbers of the "
                "board, whether it is flat, and the lens model"
            )
        else:
            singles[row] = single
        progress(0.5 * (row + 1) / n_cameras)
    if lens != "fisheye":
        singles = _best_lenses(singles, own, corners, sizes)
    progress(0.7)
    if len(singles) < 2:
        return shortened([f"{{{row}}}: {why}" for row, why in unusable.items()])
    held = [_held(moment, singles, corners) for moment in views]
    group = joined(n_cameras, held)
    if group is None:
        return _said_apart(held)
    rows = group.rows
    cameras = _together([singles[int(row)].camera for row in rows], group.poses)
    moments = [i for i, moment in enumerate(held) if sum(int(row) in moment for row in rows) >= 2]
    places = RigidPlaces(corners, *_placed(moments, held, views, rows, cameras, corners))
    number = {int(row): i for i, row in enumerate(rows)}
    seen = sightings(
        [(number[row], place, views[i][row]) for place, i in enumerate(moments) for row in held[i] if row in number],
        len(corners),
    )
    own_errors = np.array([singles[int(row)].error_px for row in rows])
    cameras, places, errors = _adjusted(cameras, places, seen, sizes[rows], is_lens_kept=True)
    if np.median(errors) < SYNCHRONOUS * np.median(own_errors):
        cameras, places, errors = _with_best_lens(cameras, places, seen, sizes[rows])
    progress(1.0)
    return BoardSolution(
        rows, cameras, places, np.array(moments), seen, errors, own_errors, n_views, group.n_common, unusable,
    )  # fmt: skip


def _held(moment: Mapping[int, BoardView], singles: Mapping[int, SingleCamera], corners: np.ndarray) -> dict[int, Pose]:
    """From the board to each camera that sees it."""
    poses = {row: pose_of(view, corners, singles[row].camera) for row, view in moment.items() if row in singles}
    return {row: pose for row, pose in poses.items() if pose is not None}


def _said_apart(held: Sequence[Mapping[int, Pose]]) -> str:
    """Why no two cameras are joined."""
    pairs = Counter(pair for moment in held for pair in combinations(sorted(moment), 2))
    if not pairs:
        return "no two of them saw the board at the same moment"
    (a, b), n = pairs.most_common(1)[0]
    return f"{{{a}}} and {{{b}}} saw the board together most often, {n} times, and {MIN_COMMON} have to agree"


def _first_lens(lens: str) -> str:
    return "fisheye" if lens == "fisheye" else "simple"


def _size(sizes: np.ndarray, row: int) -> tuple[int, int]:
    return int(sizes[row, 0]), int(sizes[row, 1])


def _best_lenses(
    singles: dict[int, SingleCamera], own: list[list[BoardView]], corners: np.ndarray, sizes: np.ndarray
) -> dict[int, SingleCamera]:
    """With one number each for the lens, or with four each where these explain more, by Akaike's measure."""
    wide = {row: refined(one, own[row], corners, _size(sizes, row), "opencv") for row, one in singles.items()}
    gain = sum(one.n * np.log(one.square_px / wide[row].square_px) for row, one in singles.items())
    return wide if gain > 2 * N_MORE * len(singles) else singles


def _with_best_lens(cameras: Cameras, places: RigidPlaces, seen: Observations, sizes: np.ndarray):
    """Adjusted with lenses, and with four numbers for each where these explain more, by the same measure."""
    found = _adjusted(cameras, places, seen, sizes, is_lens_kept=False)
    if found[0].lens != "simple":
        return found
    wide = _adjusted(with_lens(found[0], "opencv"), found[1], seen, sizes, is_lens_kept=False)
    limit = 3 * np.median(found[2])
    squares = [float(np.mean(np.minimum(errors, limit) ** 2)) for errors in (found[2], wide[2])]
    return wide if len(seen) * np.log(squares[0] / squares[1]) > 2 * N_MORE * len(cameras) else found


def _adjusted(cameras: Cameras, places: RigidPlaces, seen: Observations, sizes: np.ndarray, *, is_lens_kept: bool):
    """Twice, the second time without what is far off."""
    reach_px = REACH_PX * sizes.max(1)[seen.cameras] / 1000
    middles, widths = sizes / 2.0, sizes[:, 0].astype(np.float64)
    errors = errors_px(cameras, places.points, seen)
    kept, expect = seen, replace(EXPECTED, is_lens_kept=is_lens_kept)
    for _ in range(2):
        cameras, places = adjust(
            cameras, places, kept, middles=middles, widths=widths, expect=expect, n_iterations=N_ITERATIONS
        )
        errors = errors_px(cameras, places.points, seen)
        is_near = errors < reach_px
        is_near |= _is_bare(places, seen, is_near)
        kept = seen.chosen(is_near)
    return cameras, places, errors


def _is_bare(places: RigidPlaces, seen: Observations, is_near: np.ndarray) -> np.ndarray:
    """Sightings in places that would be left with none."""
    owners = places.owners(seen.points)
    return np.bincount(owners, is_near, minlength=len(places.rotations))[owners] == 0


def _together(singles: Sequence[Cameras], poses: Sequence[Pose]) -> Cameras:
    return Cameras(
        singles[0].lens,
        np.array([pose[0] for pose in poses]),
        np.array([pose[1] for pose in poses]),
        *(np.concatenate([getattr(single, name) for single in singles])
          for name in ("focals", "aspects", "principal", "lens_params")),
    )  # fmt: skip


def _placed(moments, held, views, rows, cameras: Cameras, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The board in the world in each moment: of what each camera says, that which all together miss least."""
    number = {int(row): i for i, row in enumerate(rows)}
    rotations, translations = [], []
    for i in moments:
        proposals = []
        for row, (rotation, translation) in held[i].items():
            if row not in number:
                continue
            turn = cameras.rotations[number[row]].T
            proposals.append((turn @ rotation, turn @ (translation - cameras.translations[number[row]])))
        seen = sightings([(number[row], 0, views[i][row]) for row in held[i] if row in number], len(corners))
        costs = [
            float(np.minimum(errors_px(cameras, corners @ rotation.T + translation, seen), 1e4).mean())
            for rotation, translation in proposals
        ]
        best = proposals[int(np.argmin(costs))]
        rotations.append(best[0])
        translations.append(best[1])
    return np.array(rotations), np.array(translations)
