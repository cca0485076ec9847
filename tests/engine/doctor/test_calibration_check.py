"""The camera that is wrong is named, with what is wrong and by how much; good cameras beside it are not."""

from __future__ import annotations

import numpy as np
import pytest

from app.lab.synthetic.rigs import forward_facing_rig, make_rig
from engine.camera.rig import CameraRig
from engine.doctor.checks.calibration import check_calibration, find_suspects
from engine.doctor.epipolar import fundamental_matrices, pair_errors, sampson_px
from engine.doctor.finding import PairEvidence
from engine.features.matching import PairMatches
from tests.engine.doctor.conftest import with_focal, with_turn

RIGS = {"ring": make_rig(20, (320, 240)), "forward": forward_facing_rig(12, (320, 240))}


def problems(rig: CameraRig, matches: list[PairMatches]) -> list[tuple[str, ...]]:
    found = check_calibration(rig, matches, pair_errors(rig, matches))
    return [finding.cameras for finding in found if finding.severity != "note"]


@pytest.mark.parametrize("name", RIGS)
def test_a_good_rig_raises_no_alarm(name, matches_in) -> None:
    assert problems(RIGS[name], matches_in(RIGS[name])) == []


@pytest.mark.parametrize("factor", [0.97, 1.03])
@pytest.mark.parametrize(("name", "camera"), [("ring", 0), ("ring", 7), ("forward", 0), ("forward", 4)])
def test_a_focal_length_three_percent_off_is_named_with_its_size(name, camera, factor, matches_in) -> None:
    rig = RIGS[name]
    wrong = with_focal(rig, camera, factor)
    matches = matches_in(rig)
    assert problems(wrong, matches) == [(rig.names[camera],)]
    (fit,) = find_suspects(wrong, matches)
    assert fit.model == "focal"
    assert (1 + fit.focal_share) * factor == pytest.approx(1.0, abs=0.008)


@pytest.mark.parametrize(("name", "camera"), [("ring", 3), ("ring", 12), ("forward", 11), ("forward", 5)])
def test_a_camera_turned_by_two_degrees_is_named_with_its_size(name, camera, matches_in) -> None:
    rig = RIGS[name]
    wrong = with_turn(rig, camera, 2.0)
    matches = matches_in(rig)
    assert problems(wrong, matches) == [(rig.names[camera],)]
    (fit,) = find_suspects(wrong, matches)
    assert fit.turn_deg == pytest.approx(2.0, abs=0.3)


def test_two_wrong_cameras_that_stand_side_by_side_are_both_named(matches_in) -> None:
    rig = RIGS["ring"]
    wrong = with_turn(with_focal(rig, 8, 1.03), 9, 2.0)
    assert sorted(problems(wrong, matches_in(rig))) == [("cam08",), ("cam09",)]


def test_evidence_shows_matches_beside_the_lines_on_which_they_ought_to_lie(matches_in) -> None:
    rig = RIGS["ring"]
    wrong = with_turn(rig, 6, 2.0)
    matches = matches_in(rig)
    finding = check_calibration(wrong, matches, pair_errors(wrong, matches), frame=3)[0]
    assert finding.fix is not None
    assert finding.fix.is_excluded == {"cam06": True}
    shown = finding.evidence[0]
    assert isinstance(shown, PairEvidence)
    assert "cam06" in (shown.camera, shown.other)
    assert shown.frame == 3
    assert len(shown.points) == len(shown.other_points) == len(shown.lines) == len(shown.errors_px) > 5
    assert 0 <= np.array(shown.points).min() <= np.array(shown.points).max() <= 1
    size = np.array([320.0, 240.0])
    for place, (start, end), missed in zip(shown.other_points, shown.lines, shown.errors_px, strict=True):
        along = (np.array(end) - np.array(start)) * size
        across = (np.array(place) - np.array(start)) * size
        distance = abs(along[0] * across[1] - along[1] * across[0]) / np.linalg.norm(along)
        assert distance >= missed * 0.9  # the error is shared with the first picture


def test_too_few_matches_name_nobody_and_say_so(matches_in) -> None:
    rig = with_turn(RIGS["ring"], 5, 2.0)
    few = [PairMatches(p.first, p.second, p.pixels[:3], p.other_pixels[:3], p.features[:3]) for p in matches_in(rig)]
    found = check_calibration(rig, few, pair_errors(rig, few))
    assert {finding.kind for finding in found} == {"few features"}
    none = [PairMatches(0, 1, np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2), int))]
    assert np.isnan(pair_errors(rig, none)[0].median_px)
    assert all(finding.severity == "note" for finding in check_calibration(rig, none, pair_errors(rig, none)))


def test_a_calibration_of_other_pictures_is_bad_as_a_whole(matches_in) -> None:
    rig = RIGS["ring"]
    order = [5, 2, 9, 0, 7, 4, 1, 8, 3, 6, 15, 12, 19, 10, 17, 14, 11, 18, 13, 16]
    mixed = CameraRig(rig.names, rig.world_to_camera[order], rig.Ks[order], rig.image_sizes)
    matches = matches_in(rig)
    found = check_calibration(mixed, matches, pair_errors(mixed, matches))
    assert "calibration" in {finding.kind for finding in found}


def test_epipolar_distance_is_that_of_the_line() -> None:
    rig = RIGS["forward"]
    F = fundamental_matrices(rig.Ks[0], rig.world_to_camera[0], rig.Ks[1], rig.world_to_camera[1])
    place = np.array([0.1, 0.4, 0.9, 1.0])
    pixels = [(rig.Ks[i] @ (rig.world_to_camera[i, :3] @ place)) for i in (0, 1)]
    here, there = (pixel[:2] / pixel[2] for pixel in pixels)
    assert sampson_px(F, here[None], there[None])[0] == pytest.approx(0.0, abs=1e-9)
    line = F @ np.append(here, 1.0)
    normal = line[:2] / np.linalg.norm(line[:2])
    missed = sampson_px(F, here[None], (there + 2.0 * normal)[None])[0]
    assert 1.0 < abs(missed) < 2.0  # shared between both pictures
