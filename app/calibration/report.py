"""The report of a calibration as sentences: how many cameras, how well they fit, what is missing, what helps."""

from __future__ import annotations

import numpy as np

from engine.calibration.calibrated import CalibratedRig, Calibration
from engine.calibration.options import WHAT_TO_FILM
from engine.calibration.pair_lines import WHAT_TO_DO, pair_lines
from engine.text import printable

GOOD_ERROR_PX = 1.0
"""Median reprojection error, at a width of 1,000 pixels, up to which no remedy is needed."""
WHAT_HELPS = (
    "What helps: a camera between it and its neighbour, or more overlap between the two; posters, boxes or other "
    "objects with fine, irregular patterns in both views; someone walking through the whole scene while all cameras "
    "film; even light; no motion blur. Or continue without it."
)


def report_lines(calibration: Calibration, *, keeps_doubtful: bool = False) -> list[str]:
    """The report for the user, one sentence or camera per line.

    Args:
        calibration: The calibration's result.
        keeps_doubtful: Whether doubtful cameras were left in use.
    """
    found = calibration.found
    rig = found.rig
    n_all = len(rig) + len(calibration.missing)
    error = float(np.median(found.camera_errors_px))
    what = "points" if found.board_frames is None else "corners of the board"
    lines = [
        f"{len(rig)} of {n_all} cameras were found, from {len(found.points):,} {what}; sightings lie {error:.2f} px "
        f"from where their points land (median)."
    ]
    lines += [_camera_line(found, row) for row in range(len(rig))]
    lines += [_missing_line(missing.name, missing.reason) for missing in calibration.missing]
    if calibration.missing:
        lines.append(WHAT_HELPS if found.board_frames is None else WHAT_TO_FILM)
    lines += [_scale_line(found), _up_line(found)]
    lines += [f"Note: {warning}" for warning in calibration.warnings]
    if calibration.failure and found.board_frames is not None:
        lines.append(calibration.failure)
    elif calibration.failure:
        lines += [calibration.failure, *map(printable, pair_lines(calibration.pairs)), WHAT_TO_DO]
    elif any(found.doubts):
        lines.append(_doubtful_line(found, keeps_doubtful=keeps_doubtful))
    return lines


def _doubtful_line(found: CalibratedRig, *, keeps_doubtful: bool) -> str:
    named = ", ".join(printable(name) for name, doubt in zip(found.rig.names, found.doubts, strict=True) if doubt)
    what = "still in use; check them before training" if keeps_doubtful else "written as excluded"
    return f"The positions of these cameras are unreliable; they are {what}: {named}."


def _camera_line(found: CalibratedRig, row: int) -> str:
    K, (width, height) = found.rig.Ks[row], found.rig.image_sizes[row]
    view = np.degrees(2 * np.arctan(width / (2 * K[0, 0])))
    error, n = found.camera_errors_px[row], found.n_sightings[row]
    doubts = [
        *(["fits badly"] if error > GOOD_ERROR_PX * width / 1000 + 0.5 else []),
        *([f"doubtful: {found.doubts[row]}"] if found.doubts[row] else []),
    ]
    lens = found.lenses[row]
    bend = f"{lens.model} {' '.join(f'{value:+.3f}' for value in lens.params)}"
    seen = f"{n} points" if found.board_frames is None else f"board in {found.board_frames[row]} frames"
    matches = "matches" if found.board_frames is None else "corners"
    text = (
        f"{width}x{height}, focal length {K[0, 0]:.1f} px ({view:.0f} degrees), {bend}, {seen}, {error:.2f} px, "
        f"{100 * found.explained_shares[row]:.0f} % of its {matches} explained"
    )
    return f"  {printable(found.rig.names[row])}: {text}" + (f" - {' and '.join(doubts)}" if doubts else "")


def _missing_line(name: str, reason: str) -> str:
    return f"  {printable(name)}: not found: {printable(reason)}"


def _scale_line(found: CalibratedRig) -> str:
    if found.board_frames is not None:
        return "Size: in metres, by the board."
    if found.is_metric:
        return "Size: in metres, by the known distance."
    return "Size: unknown; one unit is not one metre. Give the distance between two cameras to get metres."


def _up_line(found: CalibratedRig) -> str:
    if found.up == "floor":
        return "Up: away from the floor, the largest level surface found below the cameras."
    if found.up == "board":
        return "Up: away from the floor, on which the board lay for a while."
    return "Up: the upper edge of most cameras' pictures."
