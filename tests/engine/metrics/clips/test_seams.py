"""Cross-clip residual: maps by hand, rows brought together, and clips evaluated one after another."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from engine.metrics.clips.evaluate import Evaluation
from engine.metrics.clips.seams import STATIC_THRESHOLD, PairRow, part_means, seam_maps, summarize
from engine.metrics.clips.summary import EvalRow
from engine.metrics.clips.trained_clip import TrainedClip
from tests.engine.metrics.tiny_clips import CLIP_LENGTH, SIZE, TinyCapture, clips, make_model, reference

STILL = np.zeros((40, 60), bool)


def truth() -> np.ndarray:
    return np.random.default_rng(0).uniform(0.2, 0.8, (40, 60, 3)).astype(np.float32)


# ---------------------------------------------------------------- two frames


def test_a_jump_of_the_render_alone_is_excess():
    picture = truth()
    maps = seam_maps(picture + np.float32(0.05), picture, picture, picture, STILL)
    assert np.allclose(maps.change, 0.05, atol=1e-6)
    assert np.allclose(maps.excess, 0.05, atol=1e-6)
    assert not maps.truth_change.any()
    assert maps.is_static.all()


def test_a_render_that_changes_with_the_truth_has_no_excess():
    before, after = truth(), truth()[:, ::-1]
    maps = seam_maps(after, before, after, before, STILL)
    assert maps.change.mean() > 0.1
    assert not maps.excess.any()
    assert np.array_equal(maps.change, maps.truth_change)


def test_change_is_the_mean_over_channels():
    picture = truth()
    after = picture + np.array([0.03, -0.06, 0.0], np.float32)
    assert np.allclose(seam_maps(after, picture, picture, picture, STILL).change, 0.03, atol=1e-6)


def test_static_pixels_follow_the_truth_and_the_masks():
    picture = truth()
    moved = picture.copy()
    moved[10:20, 10:30] += 0.2
    mask = STILL.copy()
    mask[30:35, 40:50] = True
    is_static = seam_maps(picture, picture, moved, picture, mask).is_static
    assert not is_static[10:20, 10:30].any()
    assert not is_static[30:35, 40:50].any()
    assert is_static[:5].all()
    assert is_static[30:35, :30].all()


def test_one_noisy_pixel_does_not_move_and_the_threshold_is_where_it_says():
    picture = truth()
    noisy = picture.copy()
    noisy[20, 30] += np.float32(0.013)  # above the threshold by itself, below it after the blur
    assert seam_maps(picture, picture, noisy, picture, STILL).is_static.all()
    for factor, expected in ((0.9, True), (1.1, False)):
        shifted = picture + np.float32(factor * STATIC_THRESHOLD)
        assert seam_maps(picture, picture, shifted, picture, STILL).is_static.all() == expected


def test_means_of_nothing_are_none():
    values = np.full((4, 4), 0.25, np.float32)
    assert part_means(values, np.ones((4, 4), bool)) == (0.25, None)
    assert part_means(values, np.zeros((4, 4), bool)) == (None, 0.25)
    values[0, 0] = np.nan
    assert part_means(values, np.arange(16).reshape(4, 4) > 3) == (0.25, None)


# ---------------------------------------------------------------- rows brought together


def pair(frame: int, *, camera: str = "a", clip_length: int = 3, **changes: Any) -> PairRow:
    row = PairRow(
        frame_index=frame,
        clip_index=frame // clip_length,
        camera=camera,
        is_held_out=camera == "b",
        is_boundary=frame % clip_length == 0,
        change_static=0.01,
        change_moving=0.1,
        truth_change_static=0.001,
        truth_change_moving=0.08,
        excess_static=0.004,
        excess_moving=0.02,
        static_share=0.9,
    )
    return replace(row, **changes)


def test_clips_that_go_on_as_they_are_have_no_seam():
    found = summarize([pair(frame, camera=camera) for camera in "ab" for frame in range(1, 9)])
    assert [b["frame_index"] for b in found["boundaries"]] == [3, 6]
    assert [b["clips"] for b in found["boundaries"]] == [[0, 1], [1, 2]]
    for measures in (*found["boundaries"], *found["cameras"].values(), *found["means"].values()):
        assert measures["score"] == pytest.approx(0.0)
        assert measures["ratio_static"] == pytest.approx(1.0)
        assert measures["ratio_moving"] == pytest.approx(1.0)
        assert measures["truth_ratio_moving"] == pytest.approx(1.0)


def test_a_seam_is_found_where_it_is():
    rows = [pair(frame, camera=camera) for camera in "ab" for frame in range(1, 9)]
    at = next(i for i, row in enumerate(rows) if (row.camera, row.frame_index) == ("b", 6))
    rows[at] = replace(rows[at], excess_static=0.004 + 2 / 255, change_static=0.03, change_moving=0.2)
    found = summarize(rows)
    first, second = found["boundaries"]
    assert first["score"] == pytest.approx(0.0)
    assert second["score"] == pytest.approx(1.0)  # 2/255 in one of two cameras
    assert second["held_out"]["score"] == pytest.approx(2.0)
    assert second["trained_on"]["score"] == pytest.approx(0.0)
    assert second["worst_camera"] == "b"
    assert second["cameras"]["b"]["ratio_static"] == pytest.approx(3.0)
    assert second["ratio_static"] == pytest.approx(2.0)
    assert found["cameras"]["b"] == {
        "is_held_out": True,
        "score": pytest.approx(1.0),
        "ratio_static": pytest.approx(2.0),
        "ratio_moving": pytest.approx(1.5),
        "truth_ratio_moving": pytest.approx(1.0),
    }
    assert found["means"]["held_out"]["boundary"]["change_static"] == pytest.approx(0.02)
    assert found["means"]["all"]["interior"]["n_pairs"] == 12


def test_the_score_uses_the_median_of_the_two_clips_only():
    odd = {1: 0.9, 2: 0.008, 4: 0.006, 5: 0.004, 7: 0.9, 8: 0.9}  # two pairs of each of the three clips
    rows = [pair(f, excess_static=odd.get(f, 0.004)) for f in range(1, 9)]
    found = summarize(rows)
    assert found["boundaries"][0]["score"] == pytest.approx(255 * (0.004 - 0.007))
    assert found["boundaries"][1]["score"] == pytest.approx(255 * (0.004 - 0.453))
    assert found["means"]["all"]["score"] == pytest.approx(255 * (0.004 - 0.23))  # the mean of the two


def test_figures_that_do_not_exist_are_none_and_counted():
    rows = [pair(frame, change_static=0.0, excess_static=None, change_moving=None) for frame in range(1, 6)]
    found = summarize(rows)
    assert found["boundaries"][0]["score"] is None
    assert found["boundaries"][0]["ratio_static"] is None  # nothing changes inside the clips: no ratio
    assert found["boundaries"][0]["ratio_moving"] is None
    assert found["boundaries"][0]["worst_camera"] is None
    missing = found["means"]["all"]["interior"]["n_missing"]
    assert missing == {"change_moving": 4, "excess_static": 4}
    empty = summarize([])
    assert empty["boundaries"] == []
    assert empty["means"]["all"]["interior"]["n_pairs"] == 0
    json.dumps([found, empty], allow_nan=False)


# ---------------------------------------------------------------- clips, one after another


@pytest.fixture
def capture() -> TinyCapture:
    """Six frames: a still wall; its middle changes from frame to frame."""
    pictures = np.full((2 * CLIP_LENGTH, SIZE[1], SIZE[0], 3), 128, np.uint8)
    for frame in range(len(pictures)):
        pictures[frame, 16:32, 20:40] = 40 * frame
    return TinyCapture(pictures)


def evaluate(capture: TinyCapture, models: list, **options: Any) -> tuple[list[EvalRow], list[PairRow]]:
    evaluation = Evaluation(
        capture,  # type: ignore[arg-type]
        cameras=[0, 1],
        holdout=[1],
        metrics="quick",
        **options,
    )
    rows: list[EvalRow] = []
    pairs: list[PairRow] = []
    before = None
    for clip, model in zip(clips(), models, strict=True):
        trained = TrainedClip(clip, model, reference())
        rows += evaluation.measure(trained, before=before, on_pair=pairs.append)
        before = trained
    return rows, pairs


def test_every_frame_has_a_row_and_every_neighbour_a_pair(capture):
    rows, pairs = evaluate(capture, [make_model(has_motion=True), make_model(has_motion=True, seed=1)])
    expected = [(c, name, f) for c in (0, 1) for name in "ab" for f in range(3 * c, 3 * c + 3)]
    assert [(row.clip_index, row.camera, row.frame_index) for row in rows] == expected
    assert [(p.clip_index, p.camera, p.frame_index) for p in pairs] == [key for key in expected if key[2] > 0]
    assert [p.frame_index for p in pairs if p.is_boundary] == [3, 3]
    assert all(p.is_held_out == (p.camera == "b") for p in pairs)
    assert all(p.is_extrapolated == p.is_boundary == (p.two_clips_static is not None) for p in pairs)


def test_a_static_scene_does_not_flicker_at_all(capture):
    """Acceptance check 6 of the method: with the gate, static pixels are exactly the same in every frame and clip."""
    capture.pictures[:] = 128
    _, pairs = evaluate(capture, [make_model(has_motion=False)] * 2)
    assert [p.change_static for p in pairs] == [0.0] * len(pairs)
    assert {p.static_share for p in pairs} == {1.0}
    assert {p.change_moving for p in pairs} == {None}
    found = summarize(pairs)["means"]["all"]
    assert found["score"] == 0.0
    assert found["ratio_static"] is None


def test_a_clip_of_another_brightness_is_a_seam_in_the_colours_of_the_camera(capture):
    capture.pictures[:] = 128
    models = [make_model(has_motion=False), make_model(has_motion=False, color=0.7)]
    _, pairs = evaluate(capture, models)
    trained, held_out = (p for p in pairs if p.is_boundary)
    assert held_out.change_static is not None
    assert trained.change_static is not None
    assert held_out.change_static > 0.05
    assert trained.change_static == pytest.approx(0.5 * held_out.change_static, rel=1e-4)  # its gain is 0.5
    assert held_out.excess_static == held_out.change_static
    boundary = summarize(pairs)["boundaries"][0]
    assert boundary["held_out"]["score"] == pytest.approx(255 * held_out.change_static)
    assert boundary["worst_camera"] == "b"
    # a clip without a field answers beyond its end with its last frame, and says so
    assert held_out.is_held
    assert held_out.two_clips_static == held_out.change_static


def test_an_instant_beyond_the_end_is_rendered_where_the_field_reaches_it(capture):
    longer = make_model(has_motion=True, n_frames=CLIP_LENGTH + 1)
    moving = longer.anchor_set("moving")
    assert moving.presence is not None
    moving.presence = moving.presence[:, [0, 1, 2, 2]]
    _, pairs = evaluate(capture, [longer, make_model(has_motion=True, seed=1)])
    boundary = next(p for p in pairs if p.is_boundary and p.camera == "b")
    assert boundary.is_extrapolated
    assert not boundary.is_held
    assert boundary.two_clips_moving is not None
    assert boundary.two_clips_moving != boundary.change_moving


def test_clips_apart_have_no_boundary(capture):
    evaluation = Evaluation(capture, cameras=[0], holdout=[], metrics="quick")  # type: ignore[arg-type]
    model = make_model(has_motion=False)
    first, second = (TrainedClip(clip, model, reference()) for clip in clips())
    pairs: list[PairRow] = []
    evaluation.measure(second, on_pair=pairs.append)
    evaluation.measure(second, before=second, on_pair=pairs.append)
    assert not any(p.is_boundary for p in pairs)
    pairs.clear()
    evaluation.measure(second, before=first, frames=[3, 5], on_pair=pairs.append)
    assert [(p.frame_index, p.is_boundary) for p in pairs] == [(3, True)]  # 5 does not follow on 3
    with pytest.raises(ValueError, match="not neighbours"):
        evaluation.boundary_maps(second, first, 0)


def test_maps_for_a_picture_are_those_of_the_row(capture):
    models = [make_model(has_motion=True), make_model(has_motion=True, seed=1)]
    _, pairs = evaluate(capture, models)
    evaluation = Evaluation(capture, cameras=[0, 1], holdout=[1])  # type: ignore[arg-type]
    before, after = (TrainedClip(clip, model, reference()) for clip, model in zip(clips(), models, strict=True))
    boundary = next(p for p in pairs if p.is_boundary)
    maps = evaluation.boundary_maps(before, after, 0)
    assert maps.change.shape == maps.excess.shape == (SIZE[1], SIZE[0])
    assert part_means(maps.change, maps.is_static) == (boundary.change_static, boundary.change_moving)
    assert part_means(maps.excess, maps.is_static) == (boundary.excess_static, boundary.excess_moving)


def test_rounding_reaches_rows_and_seams(capture):
    models = [make_model(has_motion=True), make_model(has_motion=True, seed=1)]
    rounded, exact = (evaluate(capture, models, precision=p) for p in ("8bit", "float"))
    assert [r.figures["psnr"] for r in rounded[0]] != [r.figures["psnr"] for r in exact[0]]
    assert [p.change_moving for p in rounded[1]] != [p.change_moving for p in exact[1]]


@pytest.mark.parametrize("precision", ["float", "8bit"])
def test_a_picture_that_is_not_finite_costs_its_figures_only(capture, monkeypatch, precision):
    import engine.metrics.clips.trained_clip as module

    render, calls = module.render_model, []

    def spoilt(*arguments: Any, **options: Any):
        image = render(*arguments, **options)
        calls.append(None)
        if len(calls) == 2:
            image[0, 0, 0] = float("nan")
        return image

    monkeypatch.setattr(module, "render_model", spoilt)
    rows, pairs = evaluate(capture, [make_model(has_motion=False)] * 2, precision=precision)
    assert [row.frame_index for row in rows if row.figures["psnr"] is None] == [1]
    assert [p.frame_index for p in pairs if p.change_static is None] == [
        1,
        2,
    ]  # the frame with it, and the one after it
    json.dumps([*(r.as_dict() for r in rows), *(p.as_dict() for p in pairs), summarize(pairs)], allow_nan=False)


def test_one_clip_by_itself_gives_the_same_rows(capture):
    models = [make_model(has_motion=True), make_model(has_motion=True, seed=1)]
    rows, _ = evaluate(capture, models)
    evaluation = Evaluation(capture, cameras=[0, 1], holdout=[1], metrics="quick")
    alone = evaluation.measure(TrainedClip(clips()[1], models[1], reference()))
    assert alone == [row for row in rows if row.clip_index == 1]
