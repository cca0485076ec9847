"""Which cameras are calibrated wrongly, in which way and by how much.

A wrong camera disagrees with all of its neighbours, a good neighbour with one only. So the camera that a change of its
own would help most is named first, left out, and the others are judged again without it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

import numpy as np

from engine.camera.rig import CameraRig
from engine.capture.cameras.rig_checks import rig_extent
from engine.capture.writers.capture_json import Corrections
from engine.doctor.epipolar import PairError, fundamental_matrices, pair_errors, sampson_px
from engine.doctor.finding import Finding, PairEvidence, Point
from engine.doctor.refit import NOISE_PX, Refit, matches_of, median_px, refit
from engine.doctor.words import listed
from engine.features.matching import PairMatches

MIN_MATCHES = 30
"""With fewer a camera is not judged."""
LEAST_PX, LEAST_TIMES = 0.6, 2.5
"""A wrong camera misses its neighbours' lines by more than this, and by so many times what is usual in the rig."""
LEAST_HELP = 0.35
"""Share of its cost that a change has to take away."""
BAD_RIG_PX, MIN_PAIRS = 1.5, 3
"""A rig whose pairs usually miss each other by more, in pictures up to 640 px wide, fits its pictures badly as a whole;
fewer pairs than that with MIN_MATCHES do not suffice."""
MIN_OF_PAIR = 8
"""Matches of a pair with fewer are not counted as agreeing or disagreeing."""
MOST_PARTNERS = 0.6
"""Share of its partners that a wrong camera disagrees with."""
N_SHOWN = 14
"""Matches that are shown of a pair."""


def check_calibration(
    rig: CameraRig,
    pairs: Sequence[PairMatches],
    errors: Sequence[PairError],
    *,
    frame: int = 0,
    tell: Callable[[float], None] = lambda done: None,
) -> list[Finding]:
    """Name the cameras whose calibration does not fit.

    Args:
        rig: At the size of the matched pictures.
        pairs: Matches that were found without the calibration.
        errors: Of these pairs.
        frame: To show as evidence.
        tell: Called with the share that is done; may raise.
    """
    findings = []
    suspects = find_suspects(rig, pairs, tell)
    is_many = len(suspects) > max(len(rig) // 3, 1)
    usual = usual_px(errors, [fit.camera for fit in suspects])
    for fit in suspects:
        findings.append(_finding(rig, pairs, errors, fit, usual, frame, is_doubtful=is_many))
    telling = [error for error in errors if error.n_matches >= MIN_MATCHES]
    whole = usual_px(telling, [])
    limit = BAD_RIG_PX * max(float(rig.image_sizes[:, 0].max()) / 640.0, 1.0)
    if (len(telling) >= MIN_PAIRS and whole > limit) or is_many:
        findings.append(_bad_rig(rig, pairs, errors, whole, frame))
    unknown = [name for row, name in enumerate(rig.names) if len(matches_of(row, pairs)) < MIN_MATCHES]
    if unknown:
        text = (
            f"{listed(unknown)} {'shares' if len(unknown) == 1 else 'share'} fewer than {MIN_MATCHES} features with "
            "neighbouring cameras, too few to check the calibration."
        )
        advice = "Check their pictures: plain walls and cameras far apart give few features, which may be harmless."
        findings.append(Finding("few features", "note", tuple(unknown), (), text, 1.0, advice))
    return findings


def usual_px(errors: Sequence[PairError], left_out: Sequence[int]) -> float:
    """The median error of pairs without these cameras, px; NaN without any."""
    kept = [
        error.median_px
        for error in errors
        if error.n_matches and error.first not in left_out and error.second not in left_out
    ]
    return float(np.median(kept)) if kept else float("nan")


def find_suspects(
    rig: CameraRig, pairs: Sequence[PairMatches], tell: Callable[[float], None] = lambda done: None
) -> list[Refit]:
    """Cameras that are wrong, the most harmful first, each as a change that makes it fit."""
    extent = rig_extent(rig)
    suspects: list[Refit] = []
    fits: dict[int, Refit] = {}
    while len(suspects) < max(len(rig) // 2, 1):
        left_out = {fit.camera for fit in suspects}
        own = {row: matches_of(row, pairs, left_out) for row in range(len(rig)) if row not in left_out}
        missed = {row: median_px(rig, one) for row, one in own.items() if len(one) >= MIN_MATCHES}
        least = _least_px(max(float(np.median(list(missed.values()))) if missed else 0.0, NOISE_PX / 2))
        doubtful = [row for row, px in missed.items() if px >= least and _disagrees(row, rig, pairs, least, left_out)]
        for done, row in enumerate(doubtful):
            if row not in fits or fits[row].n_matches != len(own[row]):  # a partner was left out since
                fits[row] = refit(rig, own[row], extent)
            tell((len(suspects) + (done + 1) / len(doubtful)) / (len(suspects) + 2))
        wrong = [fits[row] for row in doubtful if _is_helped(fits[row])]
        if not wrong:
            break
        suspects.append(max(wrong, key=lambda fit: (fit.cost - fit.cost_left) / fit.n_matches))
    return suspects


def _least_px(usual_px: float) -> float:
    return max(LEAST_PX, LEAST_TIMES * usual_px)


def _disagrees(
    camera: int, rig: CameraRig, pairs: Sequence[PairMatches], least_px: float, left_out: Collection[int]
) -> bool:
    """Whether the camera misses most of its partners: a partner that is wrong itself explains one of them only."""
    own = [p for p in pairs if camera in (p.first, p.second) and not {p.first, p.second} & set(left_out)]
    medians = [error.median_px for error in pair_errors(rig, own) if error.n_matches >= MIN_OF_PAIR]
    return sum(median > least_px for median in medians) >= max(MOST_PARTNERS * len(medians), 2)


def _is_helped(fit: Refit) -> bool:
    """Whether a change of the camera explains its misses."""
    return fit.cost - fit.cost_left > LEAST_HELP * fit.cost and fit.after_px < 0.6 * fit.before_px


def _finding(
    rig: CameraRig,
    pairs: Sequence[PairMatches],
    errors: Sequence[PairError],
    fit: Refit,
    usual: float,
    frame: int,
    *,
    is_doubtful: bool,
) -> Finding:
    name = rig.names[fit.camera]
    gain = 1.0 - fit.cost_left / max(fit.cost, 1e-9)
    certainty = min(0.55 + 0.35 * gain + 0.02 * fit.n_partners + 0.0004 * fit.n_matches, 0.98)
    if is_doubtful:
        certainty *= 0.6
    kind = "focal length" if fit.model == "focal" else "pose"
    return Finding(
        kind=kind,
        severity="error" if fit.before_px > 4.0 else "warning",
        cameras=(name,),
        frames=(),
        text=f"{_what(name, fit)}: features miss by {fit.before_px:.1f} px (usual here {usual:.1f} px), after that "
        f"change by {fit.after_px:.1f} px; {fit.n_matches} features shared with {fit.n_partners} cameras.",
        certainty=certainty,
        advice="Calibrate this camera again, or leave it out: a wrong camera blurs the whole result.",
        fix=Corrections(is_excluded={name: True}),
        evidence=_worst_pairs(rig, pairs, errors, fit.camera, frame),
    )


def _what(name: str, fit: Refit) -> str:
    focal = f"{100 * abs(fit.focal_share):.1f} % too {'short' if fit.focal_share > 0 else 'long'}"
    turn = f"{fit.turn_deg:.1f} degrees"
    shift = f"{100 * fit.shift_share:.1f} % of the rig's extent"
    if fit.model == "focal":
        return f"The focal length of {name} is {focal}"
    if fit.model == "rotation":
        return f"{name} is turned by {turn} against its calibration"
    if fit.model == "rotation and focal":
        return f"{name} is turned by {turn}, and its focal length is {focal}"
    moved = f"{name} is turned by {turn} and is {shift} away from its calibrated position"
    return moved if fit.model == "pose" else f"{moved}, and its focal length is {focal}"


def _bad_rig(
    rig: CameraRig, pairs: Sequence[PairMatches], errors: Sequence[PairError], usual: float, frame: int
) -> Finding:
    ranked = sorted((error for error in errors if error.n_matches), key=lambda error: -error.median_px)
    return Finding(
        kind="calibration",
        severity="warning",
        cameras=(),
        frames=(),
        text=f"The calibration as a whole fits the pictures badly: features of two cameras usually miss by "
        f"{usual:.1f} px.",
        certainty=0.8,
        advice="Check that the calibration belongs to these videos (size, lens, order of cameras), or calibrate again.",
        evidence=tuple(_pair_evidence(rig, pairs, error, frame) for error in ranked[:2]),
    )


def _worst_pairs(
    rig: CameraRig, pairs: Sequence[PairMatches], errors: Sequence[PairError], camera: int, frame: int
) -> tuple[PairEvidence, ...]:
    own = [error for error in errors if error.n_matches >= 8 and camera in (error.first, error.second)]
    own.sort(key=lambda error: -error.median_px)
    return tuple(_pair_evidence(rig, pairs, error, frame) for error in own[:3])


def _pair_evidence(rig: CameraRig, pairs: Sequence[PairMatches], error: PairError, frame: int) -> PairEvidence:
    """Some matches of a pair, spread over the picture, with the lines on which they ought to lie."""
    pair = next(p for p in pairs if (p.first, p.second) == (error.first, error.second))
    a, b = pair.first, pair.second
    F = fundamental_matrices(rig.Ks[a], rig.world_to_camera[a], rig.Ks[b], rig.world_to_camera[b])
    missed = np.abs(sampson_px(F, pair.pixels, pair.other_pixels))
    order = np.lexsort([pair.pixels[:, 1], pair.pixels[:, 0]])
    rows = order[np.unique(np.linspace(0, len(order) - 1, min(N_SHOWN, len(order))).round().astype(int))]
    here, there = rig.image_sizes[a], rig.image_sizes[b]
    lines = np.concatenate([pair.pixels[rows], np.ones((len(rows), 1))], 1) @ F.T
    return PairEvidence(
        camera=rig.names[a],
        other=rig.names[b],
        frame=frame,
        caption=f"{error.n_matches} features miss by {error.median_px:.1f} px",
        points=tuple(_share(pixel, here) for pixel in pair.pixels[rows]),
        other_points=tuple(_share(pixel, there) for pixel in pair.other_pixels[rows]),
        lines=tuple(_ends(line, there) for line in lines),
        errors_px=tuple(round(float(value), 2) for value in missed[rows]),
    )


def _share(pixel: np.ndarray, size: np.ndarray) -> Point:
    return float(pixel[0] / size[0]), float(pixel[1] / size[1])


def _ends(line: np.ndarray, size: np.ndarray) -> tuple[Point, Point]:
    """Where a line a x + b y + c = 0 crosses the picture, as shares of its size; twice the same corner if nowhere."""
    a, b, c = (float(value) for value in line)
    width, height = float(size[0]), float(size[1])
    found: list[Point] = []
    if abs(b) > 1e-12:
        found += [(x / width, y / height) for x in (0.0, width) if 0 <= (y := -(a * x + c) / b) <= height]
    if abs(a) > 1e-12:
        found += [(x / width, y / height) for y in (0.0, height) if 0 <= (x := -(b * y + c) / a) <= width]
    if len(found) < 2:
        return (0.0, 0.0), (0.0, 0.0)
    return min(found), max(found)
