"""What the capture doctor finds: errors written into good calibrations, one camera after another.

    python -m tests.benchmarks.bench_doctor CAPTURE [CAPTURE ...] [--every 1]

Features of real pictures are matched once for each capture; then its calibration is judged as it is, with the focal
length of one camera 3 % too long or too short, and with one camera turned by two degrees, for every camera in turn.
Generated places in a ring of 20 and a forward-facing rig of 12, a tenth of the matches wrong, come last.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from app.lab.synthetic.rigs import forward_facing_rig, make_rig
from engine.camera.rig import CameraRig
from engine.capture.capture import open_capture
from engine.doctor.checks.calibration import check_calibration
from engine.doctor.epipolar import pair_errors
from engine.doctor.neighbours import neighbour_pairs
from engine.doctor.picture_survey import look_at
from engine.features.matching import PairMatches, match_pairs
from tests.benchmarks.options import ending_on_bad_input
from tests.documents.table import table
from tests.engine.doctor.conftest import made_matches, with_focal, with_turn

SIZE = (320, 240)
ERRORS: dict[str, Callable[[CameraRig, int], CameraRig]] = {
    "focal length 3 % too short": lambda rig, camera: with_focal(rig, camera, 0.97),
    "focal length 3 % too long": lambda rig, camera: with_focal(rig, camera, 1.03),
    "turned by 2 degrees": lambda rig, camera: with_turn(rig, camera, 2.0),
}


def matches_of(path: Path) -> tuple[CameraRig, Sequence[PairMatches]]:
    """A capture's rig at the size at which the doctor matches, and what it matches."""
    look = look_at(open_capture(path))
    backgrounds = np.stack([camera.background for camera in look.cameras if camera is not None])
    height, width = backgrounds.shape[1:3]
    rig = look.capture.rig.resized(np.tile([width, height], (len(backgrounds), 1)))
    return rig, match_pairs(backgrounds, neighbour_pairs(rig)).pairs


def named(rig: CameraRig, pairs: Sequence[PairMatches]) -> list[tuple[str, ...]]:
    """Cameras that a warning or worse names."""
    findings = check_calibration(rig, pairs, pair_errors(rig, pairs))
    return [finding.cameras for finding in findings if finding.severity != "note"]


def rows_of(title: str, rig: CameraRig, pairs: Sequence[PairMatches], every: int) -> list[tuple[str, ...]]:
    """One row without an error and one for each kind."""
    alarms = len(named(rig, pairs))
    missed_px = np.nanmedian([error.median_px for error in pair_errors(rig, pairs)])
    rows = [(title, f"none (misses by {missed_px:.2f} px)", "", str(alarms))]
    for error, make in ERRORS.items():
        found = [(camera, named(make(rig, camera), pairs)) for camera in range(0, len(rig), every)]
        n_right = sum((rig.names[camera],) in cameras for camera, cameras in found)
        n_false = sum(cameras != (rig.names[camera],) for camera, all_of in found for cameras in all_of)
        rows.append((title, error, f"{n_right} of {len(found)}", str(n_false)))
    return rows


def main() -> None:
    """Command line; see the module docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("captures", type=Path, nargs="+")
    parser.add_argument("--every", type=int, default=1, help="only every n-th camera gets an error")
    options = parser.parse_args()
    rows: list[tuple[str, ...]] = []
    for path in options.captures:
        with ending_on_bad_input():
            rig, pairs = matches_of(path)
            rows += rows_of(f"{path.name}, {len(rig)} cameras", rig, pairs, options.every)
    for title, rig in (("ring", make_rig(20, SIZE)), ("forward-facing", forward_facing_rig(12, SIZE))):
        rows += rows_of(f"generated, {title}, {len(rig)} cameras", rig, made_matches(rig), options.every)
    print(table(("capture", "error in one camera", "named", "others named"), rows))


if __name__ == "__main__":
    main()
