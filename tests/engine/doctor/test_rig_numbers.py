"""What numbers alone tell: coverage, twins, image sizes, cameras to hold out, counts of frames, masks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.lab.synthetic.rigs import forward_facing_rig, half_dome_rig, make_rig
from engine.camera.rig import CameraRig
from engine.capture.capture import open_capture
from engine.doctor.checks.coverage import check_coverage, measure_coverage
from engine.doctor.checks.holdout import check_holdout, good_holdout
from engine.doctor.checks.twins import check_twins
from engine.doctor.finding import Finding, in_order
from engine.doctor.neighbours import neighbour_pairs
from engine.doctor.quick import quick_findings
from tests.engine.capture.conftest import *  # noqa: F403  its fixtures

RIGS = [make_rig(20, (320, 240)), forward_facing_rig(12, (320, 240)), half_dome_rig(16, (320, 240))]


@pytest.mark.parametrize("rig", RIGS)
def test_good_rigs_raise_no_alarm(rig) -> None:
    found = [*check_coverage(rig, measure_coverage(rig)), *check_twins(rig), *check_holdout(rig, ())]
    assert {finding.severity for finding in found} <= {"note"}
    assert "twins" not in {finding.kind for finding in found}


@pytest.mark.parametrize("rig", RIGS)
def test_every_camera_has_partners_and_no_pair_comes_twice(rig) -> None:
    pairs = neighbour_pairs(rig)
    assert len(set(pairs)) == len(pairs)
    assert all(a < b for a, b in pairs)
    assert set(np.array(pairs).ravel().tolist()) == set(range(len(rig)))


def test_cameras_inside_a_wall_are_held_out_not_those_at_its_edge() -> None:
    rig = forward_facing_rig(16, (320, 240))
    chosen = good_holdout(rig)
    assert len(chosen) == 2
    assert not {0, 7, 8, 15} & set(chosen)
    (advice,) = check_holdout(rig, (rig.names[0],))
    assert advice.cameras == (rig.names[0],)
    assert advice.fix is not None
    assert advice.fix.holdout == tuple(rig.names[row] for row in chosen)
    assert check_holdout(rig, tuple(advice.fix.holdout or ())) == []


def test_held_out_cameras_of_a_ring_are_spread_and_never_doubtful() -> None:
    rig = make_rig(20, (320, 240))
    first, second = good_holdout(rig)
    assert 8 <= second - first <= 12
    assert not set(good_holdout(rig, doubtful={first, second})) & {first, second}
    assert good_holdout(make_rig(4, (320, 240))) == []


def test_a_camera_listed_twice_is_told() -> None:
    rig = make_rig(12, (320, 240))
    poses = rig.world_to_camera.copy()
    poses[5] = poses[4]
    poses[5, 0, 3] += 1e-3
    (finding,) = check_twins(replace(rig, world_to_camera=poses))
    assert finding.cameras == ("cam04", "cam05")
    assert finding.fix is not None
    assert finding.fix.is_excluded == {"cam05": True}


def test_a_camera_that_looks_away_is_little_covered() -> None:
    rig = make_rig(12, (320, 240))
    poses = rig.world_to_camera.copy()
    poses[3, :3] = np.diag([-1.0, 1.0, -1.0]) @ poses[3, :3]
    away = replace(rig, world_to_camera=poses)
    coverage = measure_coverage(away)
    assert coverage.shares[3] < 0.5 < 0.6 < np.delete(coverage.shares, 3).min()
    assert "cam03" in {name for finding in check_coverage(away, coverage) for name in finding.cameras}


def test_wide_gaps_and_single_cameras_are_told() -> None:
    rig = make_rig(6, (320, 240))
    kinds = {finding.kind for finding in check_coverage(rig, measure_coverage(rig))}
    assert "gaps" in kinds
    one: CameraRig = rig.subset([0])
    (finding,) = check_coverage(one, measure_coverage(one))
    assert finding.severity == "error"


def test_short_cameras_odd_sizes_and_unused_masks_are_seen_without_pictures(make_sample) -> None:
    def edit(document) -> None:
        document["cameras"][1]["K"][0][2] += 0.3 * document["cameras"][1]["width"]

    folder = make_sample(n_cameras=4, n_frames=6, edit=edit)
    masks = folder / "masks" / "cam02"
    masks.mkdir(parents=True)
    for frame in range(6):
        (masks / f"{frame:03d}.png").touch()
    found = {finding.kind: finding for finding in quick_findings(open_capture(folder))}
    assert found["image size"].cameras == ("cam01",)
    assert found["masks"].fix is not None
    assert found["masks"].fix.masks == {"cam02": "masks/cam02/*.png"}


def test_the_worst_comes_first() -> None:
    def finding(severity, certainty) -> Finding:
        return Finding("x", severity, (), (), "", certainty, "")

    given = [finding("note", 1.0), finding("warning", 0.5), finding("error", 0.2), finding("warning", 0.9)]
    assert [(f.severity, f.certainty) for f in in_order(given)] == [
        ("error", 0.2),
        ("warning", 0.9),
        ("warning", 0.5),
        ("note", 1.0),
    ]
    words = [finding("note", certainty).certainty_word for certainty in (1.0, 0.85, 0.7, 0.4, 0.1)]
    assert words == ["certain", "very likely", "likely", "possible", "a guess"]
