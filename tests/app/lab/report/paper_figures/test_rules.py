"""Which places the figures choose by themselves."""

from __future__ import annotations

import numpy as np

from app.lab.report.paper_figures.by_hand import InsetWindow, Places
from app.lab.report.paper_figures.change_maps import chosen_boundary
from app.lab.report.paper_figures.crops import pictures_that_differ, window_that_differs
from app.lab.report.paper_figures.features import chosen_pictures
from app.lab.report.paper_figures.pictured import trained_on
from tests.app.lab.report.paper_figures.made_up import clip, compared, pictured

THREE = [clip(0, 0, 3), clip(1, 3, 3), clip(2, 6, 3)]


def test_the_boundary_is_the_one_with_the_largest_mean_excess():
    first = compared("p", THREE, excess={("a", 3): 0.09, ("b", 6): 0.05, ("c", 6): 0.5, ("a", 4): 0.9})
    other = compared("q", THREE, excess={("a", 3): 0.01, ("b", 6): 0.08})
    assert chosen_boundary(pictured(first, other), Places()) == (6, "b")
    assert chosen_boundary(pictured(first), Places()) == (3, "a")  # neither a training camera nor inside a clip
    assert chosen_boundary(pictured(first, other), Places(boundary=3)) == (3, "a")
    assert chosen_boundary(pictured(first, other), Places(camera="c")) == (6, "c")
    assert chosen_boundary(pictured(first, other), Places(boundary=3, camera="b")) == (3, "b")


def test_boundaries_are_those_of_the_first_project_if_it_has_any():
    shorter = compared("q", [clip(0, 0, 3), clip(1, 3, 6)], excess={("b", 3): 0.3})
    joint = compared("j", [clip(0, 0, 9)])
    own = compared("p", [clip(0, 0, 6), clip(1, 6, 3)], excess={("b", 3): 0.3})
    assert chosen_boundary(pictured(own, shorter), Places()) == (6, "a")
    assert chosen_boundary(pictured(joint, shorter), Places()) == (3, "b")
    assert chosen_boundary(pictured(joint), Places()) is None


def test_where_nothing_was_measured_the_first_boundary_is_taken():
    nothing = dict.fromkeys(((camera, frame) for camera in "abc" for frame in range(9)), None)
    assert chosen_boundary(pictured(compared("p", THREE, excess=nothing)), Places()) == (3, "a")


def test_crops_are_of_pictures_in_which_psnr_is_spread_widest():
    first = compared("p", THREE, psnr={("a", 1): 25.0, ("a", 2): 24.9, ("b", 7): 23.0, ("c", 4): 40.0, ("b", 0): 22.9})
    other = compared("q", THREE, psnr={("b", 5): 19.0})
    assert pictures_that_differ(pictured(first, other)) == [("a", 1), ("b", 7), ("b", 5)]  # one of each clip
    one_clip = [
        compared(name, [clip(0, 0, 9)], psnr={("a", 1): 20 + psnr, ("a", 2): 20 + 2 * psnr, ("b", 8): 20 + psnr})
        for name, psnr in (("p", 0.0), ("q", 2.0), ("r", -2.0))
    ]
    assert pictures_that_differ(pictured(*one_clip)) == [("a", 2), ("b", 8)]  # then one of each camera
    assert pictures_that_differ(pictured(first)) == []


def test_projects_that_lack_a_picture_do_not_decide():
    first, other = compared("p", THREE), compared("q", THREE[:1], psnr={("a", 0): 30.0})
    projects = pictured(first, other)
    assert pictures_that_differ(projects) == [("a", 0), ("b", 0)]
    shown, said = trained_on(projects, (3, 4))
    assert [one.name for one in shown] == ["p"]
    assert said == ["Not trained on frames 3 and 4, so not here: q."]


def test_the_window_is_where_the_renders_differ_most(rng):
    renders = list(rng.random((3, 24, 32, 3), np.float32) * 0.1)
    renders[1][9:13, 20:24] += 0.5
    window = window_that_differs(renders, "a", 4)
    difference = np.stack(renders).astype(np.float64).std(0).mean(2)
    means = {
        (x, y): difference[y : y + 6, x : x + 6].mean() for y in range(24 - 6 + 1) for x in range(32 - 6 + 1)
    }  # a quarter of the shorter side
    x, y = max(means, key=lambda place: means[place])
    assert window == InsetWindow("a", 4, x, y, 6, 6)
    renders[0][0, 0] = np.nan
    assert window_that_differs(renders, "a", 4) == window
    assert window_that_differs([renders[1]] * 2, "a", 4) == InsetWindow("a", 4, 0, 0, 6, 6)


def test_features_are_shown_where_most_moves():
    (own,) = pictured(compared("p", THREE))
    shown = [(row["clip_index"], row["camera"], row["frame_index"]) for row in chosen_pictures(own)]
    assert shown == [(0, "a", 2), (2, "a", 7)]
    (own,) = pictured(compared("p", THREE[:1]))
    assert [row["clip_index"] for row in chosen_pictures(own)] == [0]
