"""tOF: two frames by hand, what has none, and where it stands among the figures of a clip."""

import numpy as np
import pytest
from scipy import ndimage

from engine.metrics.clips.evaluate import Evaluation
from engine.metrics.clips.flicker import FLOW_FIGURES, flicker_figures
from engine.metrics.clips.seams import PairRow, summarize
from engine.metrics.clips.tof import MIN_SIDE_PX, Motion, grey_levels, motion_of, tof
from engine.metrics.clips.trained_clip import TrainedClip
from engine.metrics.pictures.colors import to_levels
from tests.engine.metrics.tiny_clips import SIZE, TinyCapture, clips, make_model, reference


def textured(shift_px: int = 0, size: tuple[int, int] = (96, 128)) -> np.ndarray:
    """A smooth random picture, moved to the right. [H, W, 3] float32 in 0..1"""
    noise = np.random.default_rng(5).uniform(0, 1, (size[0] + 40, size[1] + 40))
    smooth = ndimage.gaussian_filter(noise, 3.0)
    smooth = np.roll((smooth - smooth.min()) / np.ptp(smooth), shift_px, 1)[20:-20, 20:-20]
    return np.repeat(smooth[..., None], 3, -1).astype(np.float32)


def motion(render: np.ndarray, truth: np.ndarray) -> Motion:
    found = motion_of(render, to_levels(truth))
    assert found is not None
    return found


def test_a_render_that_moves_as_the_truth_does_has_none():
    before, after = textured(), textured(2)
    assert tof(motion(before, before), motion(after, after)) == 0.0


@pytest.mark.parametrize("shift_px", [1, 2, -3])
def test_a_render_that_moves_alone_has_its_shift(shift_px):
    truth = textured()
    found = tof(motion(truth, truth), motion(textured(shift_px), truth))
    assert found == pytest.approx(abs(shift_px), rel=0.1)


def test_a_render_that_stands_while_the_truth_moves_has_the_same():
    truth, moved = textured(), textured(2)
    standing = tof(motion(truth, truth), motion(truth, moved))
    assert standing == tof(motion(truth, truth), motion(moved, truth))


def test_only_what_the_camera_sees_and_the_middle_count():
    truth = textured()
    half = truth.copy()
    half[:, 64:] = textured(2)[:, 64:]
    is_left = np.zeros(truth.shape[:2], bool)
    is_left[:, :40] = True
    frames = motion(truth, truth), motion(half, truth)
    left, whole, right = tof(*frames, is_left), tof(*frames), tof(*frames, ~is_left)
    assert left is not None
    assert whole is not None
    assert right is not None
    assert left < 0.05 < whole < right
    assert tof(*frames, np.zeros_like(is_left)) is None
    border = np.ones_like(is_left)
    border[8:-8, 8:-8] = False  # a height of 96 px leaves 64 in the middle, a width of 128 leaves 96
    assert tof(*frames, border) is None


def test_pictures_of_one_colour_have_none_and_small_ones_no_figure():
    flat = np.full((64, 64, 3), 0.5, np.float32)
    assert tof(motion(flat, flat), motion(flat, flat)) == 0.0
    assert motion_of(flat[: MIN_SIDE_PX - 1], to_levels(flat[: MIN_SIDE_PX - 1])) is None
    smallest = flat[:MIN_SIDE_PX]
    assert tof(motion(smallest, smallest), motion(smallest, smallest)) == 0.0


def test_grey_is_that_of_television():
    levels = np.array([[[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255], [1, 1, 1]]], np.uint8)
    assert grey_levels(levels).tolist() == [[76.0, 150.0, 29.0, 255.0, 1.0]]


# ---------------------------------------------------------------- clips


@pytest.fixture
def capture() -> TinyCapture:
    pictures = np.stack([to_levels(textured(frame, (SIZE[1], SIZE[0]))) for frame in range(6)])
    return TinyCapture(pictures)


def pairs_of(capture: TinyCapture, *, holdout: list[int], metrics: str = "all") -> list[PairRow]:
    evaluation = Evaluation(capture, cameras=[0, 1], holdout=holdout, metrics=metrics)  # type: ignore[arg-type]
    pairs: list[PairRow] = []
    before = None
    for clip in clips():
        trained = TrainedClip(clip, make_model(has_motion=False), reference())
        evaluation.measure(trained, before=before, on_pair=pairs.append)
        before = trained
    return pairs


def test_pairs_of_held_out_cameras_have_it_with_all_metrics(capture):
    """The wall of the render stands still, the truth moves by a pixel a frame."""
    pairs = pairs_of(capture, holdout=[1])
    assert {pair.camera for pair in pairs if pair.tof is not None} == {"b"}
    found = [pair.tof for pair in pairs if pair.tof is not None]
    assert len(found) == 5
    assert found == pytest.approx([1.0] * 5, rel=0.25)
    means = summarize(pairs)["means"]
    assert means["held_out"]["tof"] == pytest.approx(np.mean(found))
    assert means["held_out"]["boundary"]["tof"] == found[2]
    assert means["trained_on"]["tof"] is None
    figures = flicker_figures([pair.as_dict() for pair in pairs])
    expected = [np.mean(found), np.mean([*found[:2], *found[3:]]), found[2]]
    assert [figures[name] for name in FLOW_FIGURES] == pytest.approx(expected)


def test_without_held_out_cameras_all_have_it_and_the_quick_choice_none(capture):
    assert all(pair.tof is not None for pair in pairs_of(capture, holdout=[]))
    quick = pairs_of(capture, holdout=[1], metrics="quick")
    assert {pair.tof for pair in quick} == {None}
    figures = flicker_figures([pair.as_dict() for pair in quick])
    assert [figures[name] for name in FLOW_FIGURES] == [None, None, None]


def test_a_frame_that_is_not_finite_costs_its_own_pairs_only(capture, monkeypatch):
    import engine.metrics.clips.trained_clip as module

    render, calls = module.render_model, []

    def spoilt(*arguments, **options):
        image = render(*arguments, **options)
        calls.append(None)
        if len(calls) == 2:
            image[0, 0, 0] = float("nan")
        return image

    monkeypatch.setattr(module, "render_model", spoilt)
    pairs = [pair for pair in pairs_of(capture, holdout=[]) if pair.camera == "a"]
    assert [pair.frame_index for pair in pairs if pair.tof is None] == [1, 2]
