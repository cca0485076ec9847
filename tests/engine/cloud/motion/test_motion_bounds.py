"""Where motion is looked for, and how many cameras have to agree on it."""

import numpy as np
import pytest

from app.lab.synthetic.rigs import make_rig
from engine.cloud.motion.moving_cloud import hull_votes, motion_bounds


@pytest.mark.parametrize(
    ("n_cameras", "expected"), [(2, (2, 0)), (3, (3, 0)), (7, (3, 0)), (8, (3, 1)), (13, (4, 1)), (40, (10, 1))]
)
def test_a_quarter_of_the_cameras_but_at_least_three_must_agree(n_cameras, expected):
    assert hull_votes(n_cameras) == expected


def test_the_box_holds_the_points_and_the_focus_but_no_stray_point(rng):
    rig = make_rig(6, (80, 60))
    points = rng.uniform(-1.0, 1.0, (1000, 3)) + np.array([10.0, 0.0, 0.0])
    points[0] = 1e6, 1e6, 1e6
    low, high = motion_bounds(points, rig)
    focus = rig.focus_point()
    assert (low <= focus).all()
    assert (focus <= high).all()
    assert (high < 20.0).all()
    is_inside = ((points[1:] >= low) & (points[1:] <= high)).all(1)
    assert is_inside.all()
