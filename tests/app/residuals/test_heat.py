"""Heat maps: the numbers of an evaluation, pixel by pixel; stale ones until they are made; a reason for none."""

from __future__ import annotations

import numpy as np
import pytest

from app.evaluation.evaluation import boundary_maps, evaluate_project
from app.evaluation.headless import open_trained
from app.project.opening.project_access import open_project
from app.residuals.figures import mean_excess
from app.residuals.heat_map import HEAT_KINDS, LEVELS
from engine.capture.capture import Capture
from engine.metrics.clips.seams import PairRow
from tests.app.residuals.conftest import until

ROUNDING = 2e-6
"""Relative: means of float32 pixels, and 255 times them."""


@pytest.fixture
def document(project):
    opened = open_trained(open_project(project, is_writable=False))
    return evaluate_project(opened, clip_indices=[0, 1], on_progress=lambda *_: None)


@pytest.mark.slow
def test_means_are_those_of_an_evaluation(open_residuals, document):
    opened = open_residuals()
    names = opened.opened.rig.names
    pairs = [PairRow(**row) for row in document["seams"]["rows"]]
    assert len(pairs) == 20
    for pair in pairs:
        camera = names.index(pair.camera)
        excess = opened.heat(camera, pair.frame_index, "E").mean
        assert excess == pytest.approx(LEVELS * (mean_excess(pair) or 0.0), rel=ROUNDING, abs=1e-9)
        for kind, what in (("R", "change"), ("G", "truth_change")):
            share = pair.static_share
            parts = (getattr(pair, f"{what}_static") or 0.0, getattr(pair, f"{what}_moving") or 0.0)
            mean = LEVELS * (share * parts[0] + (1 - share) * parts[1])
            assert opened.heat(camera, pair.frame_index, kind).mean == pytest.approx(mean, rel=ROUNDING)
    assert max(pair.change_moving or 0.0 for pair in pairs if not pair.is_boundary) > 0.0  # drift shows inside clips
    for row in document["rows"]:
        camera = names.index(row["camera"])
        flip = opened.heat(camera, row["frame_index"], "flip")
        assert flip.mean == pytest.approx(row["flip"], rel=ROUNDING)
        assert flip.clip_index == row["clip_index"]


def test_pixels_are_those_of_the_maps_of_a_boundary(open_residuals, project):
    opened = open_residuals()
    trained = open_trained(open_project(project, is_writable=False))
    for camera in range(4):
        maps = boundary_maps(trained, clip_index=1, camera_index=camera)
        for kind, values in (("R", maps.change), ("G", maps.truth_change), ("E", maps.excess)):
            heat = opened.heat(camera, 3, kind)
            assert heat.values.dtype == np.float32
            np.testing.assert_array_equal(heat.values, np.float32(LEVELS) * values)


def test_error_and_luminance_are_of_the_picture_that_is_measured(open_residuals, document):
    opened = open_residuals()
    trained = open_trained(opened.project)
    picture = np.clip(trained.load(1).picture(opened.opened.rig, 2, 1 / 3), 0.0, 1.0)
    truth = opened.opened.capture.frame(2, 4) / 255.0
    np.testing.assert_allclose(opened.heat(2, 4, "error").values, 255 * np.abs(picture - truth).mean(2), atol=1e-4)
    luminance = 255 * (picture - truth) @ [0.2126, 0.7152, 0.0722]
    np.testing.assert_allclose(opened.heat(2, 4, "luminance").values, luminance, atol=1e-4)
    assert luminance.min() < 0 < luminance.max()
    row = next(
        row for row in document["rows"] if (row["frame_index"], row["camera"]) == (4, opened.opened.rig.names[2])
    )
    assert row["psnr"] == pytest.approx(-10 * np.log10(((picture - truth) ** 2).mean()), rel=1e-5)


@pytest.mark.slow
def test_two_clips_at_one_instant(open_residuals, document):
    opened = open_residuals()
    for row in document["seams"]["rows"]:
        if not row["is_boundary"]:
            continue
        share = row["static_share"]
        mean = share * (row["two_clips_static"] or 0.0) + (1 - share) * (row["two_clips_moving"] or 0.0)
        heat = opened.heat(opened.opened.rig.names.index(row["camera"]), 3, "clips")
        assert heat.mean == pytest.approx(LEVELS * mean, rel=ROUNDING)
        assert heat.is_extrapolated
        assert "Clip 0 ends before this frame; its last frame stands in, which shows no more than R" in heat.note
    assert (
        "Clip 1 begins after this frame; its first frame stands in, which shows no more than R"
        in opened.heat(0, 2, "clips").note
    )
    for frame, note in (
        (1, "Frame 1 lies inside clip 0; two clips meet at its first and last frame only."),
        (0, "No other clip meets clip 0 at frame 0."),
        (5, "No other clip meets clip 1 at frame 5."),
    ):
        heat = opened.heat(0, frame, "clips")
        assert heat.values is None
        assert heat.note == note


def test_until_it_is_made_the_last_one_of_the_same_kind_and_camera_is_stale(open_residuals):
    opened = open_residuals()
    assert opened.residuals.heat(opened.timeline, 1, "error") is None
    first = opened.heat(1, 0, "error")
    opened.timeline.seek(4)
    assert opened.residuals.heat(opened.timeline, 2, "error") is None
    stale = opened.residuals.heat(opened.timeline, 1, "error")
    assert stale.is_stale
    assert stale.key == first.key
    assert stale.frame_index == 0
    fresh = until(lambda: opened.residuals.heat(opened.timeline, 1, "error"), lambda heat: not heat.is_stale, opened)
    assert fresh.frame_index == 4
    assert opened.heat(1, 0, "error") is first  # kept


def test_a_reason_where_there_is_none(open_residuals, project):
    (project / "clips" / "0001.safetensors").unlink()
    opened = open_residuals()
    for kind in ("R", "G", "E"):
        assert opened.heat(0, 0, kind).note == "Frame 0 has no previous frame."
    for kind in ("R", "E", "error", "luminance", "flip", "clips"):
        heat = opened.heat(0, 3, kind)
        assert heat.values is None
        assert heat.mean is None
        assert heat.note == "Clip 1 is not trained."
    assert opened.heat(0, 2, "clips").note == "No render of the neighbour's picture: clip 1 is not trained."
    assert opened.heat(0, 3, "G").values is not None  # needs no render


def test_without_its_reference_a_clip_is_out_of_date(open_residuals, project):
    (project / "clips" / "0000.safetensors").unlink()
    opened = open_residuals()
    heat = opened.heat(0, 4, "error")
    assert (heat.values, "Clip 1" in heat.note) == (None, True)


def test_a_damaged_clip_is_told_once_and_then_a_reason(open_residuals, project):
    opened = open_residuals()
    path = project / "clips" / "0001.safetensors"
    content = bytearray(path.read_bytes())
    content[-20] ^= 0xFF
    path.write_bytes(content)
    opened.timeline.seek(4)
    assert opened.residuals.heat(opened.timeline, 0, "error") is None
    assert opened.residuals._heat.worker.wait_idle(60.0)
    (failure,) = opened.residuals.take_failures()
    assert failure.is_of_clip
    assert failure.error.path == path
    heat = opened.residuals.heat(opened.timeline, 0, "error")
    assert heat.values is None
    assert heat.note == failure.error.message
    assert opened.residuals.take_failures() == []


def test_a_capture_that_disappears_is_a_reason(open_residuals):
    opened = open_residuals()
    for file in (opened.opened.capture.path / "ims" / "3").iterdir():
        file.unlink()
    opened.timeline.seek(1)
    camera = opened.opened.rig.names.index("3")
    assert opened.residuals.heat(opened.timeline, camera, "G") is None
    assert opened.residuals._heat.worker.wait_idle(60.0)
    (failure,) = opened.residuals.take_failures()
    assert not failure.is_of_clip
    assert opened.residuals.heat(opened.timeline, camera, "G").note == failure.error.message


def test_clips_that_playback_has_loaded_are_not_loaded_again(open_residuals, monkeypatch):
    opened = open_residuals()
    opened.timeline.seek(4)
    opened.playback.frame(opened.timeline)
    assert opened.playback.decoder.worker.wait_idle(60.0)
    monkeypatch.setattr("app.playback.frame_decoder.read_clip_state", None)
    assert opened.heat(0, 4, "R").values is not None


def test_kinds_have_a_unit_and_a_fixed_range():
    assert list(HEAT_KINDS) == ["R", "G", "E", "error", "luminance", "flip", "clips"]
    for kind in HEAT_KINDS.values():
        low, high = kind.value_range
        assert low < high
        assert (low == -high) == (kind.color_map == "signed")
        assert kind.unit in ("1/255", "1")


def test_unknown_kinds_are_errors_of_the_caller(open_residuals):
    opened = open_residuals()
    with pytest.raises(KeyError):
        opened.residuals.heat(opened.timeline, 0, "heat")
    with pytest.raises(ValueError, match="columns of anchors are error, E, not 'psnr'"):
        opened.residuals.anchor_heat(opened.timeline, "psnr")


def test_what_a_camera_does_not_see_is_blank_and_not_counted(open_residuals, monkeypatch):
    opened = open_residuals()
    plain = opened.heat(1, 4, "error").values
    height, width = plain.shape
    is_valid = np.zeros((height, width), bool)
    is_valid[height // 4 :, : width // 2] = True
    monkeypatch.setattr(Capture, "valid", lambda self, camera_index: is_valid)
    opened.close()
    found = open_residuals().heat(1, 4, "error")
    np.testing.assert_array_equal(np.isnan(found.values), ~is_valid)
    np.testing.assert_array_equal(found.values[is_valid], plain[is_valid])
    assert found.mean == pytest.approx(plain[is_valid].mean(), rel=ROUNDING)
