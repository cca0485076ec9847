"""Optical flow against numbers of OpenCV 5.0: it is called with the parameters of published figures."""

import numpy as np
import pytest
from scipy import ndimage

from app.lab.added.tof import grey_levels, optical_flow
from engine.metrics.pictures.colors import to_levels
from tests.engine.metrics.made_pictures import disturbed, scene

OPENCV = {
    (97, 131): [0.544614, -0.0152811, 0.291114, 0.081112, 0.00452593, 0.00250679, 0.978854, -0.0386926, 0.0634887],
    (20, 17): [0.98122, 0.0177419, 0.170559, 0.0354721, 1.01575, 0.031816, 1.02456, 0.0121529, 0.98607],
    (300, 280): [0.594727, -0.000160574, 0.204724, 0.0978862, 0.0451367, 0.0340489, 0.957542, 0.0223678, 0.0893969],
}
"""Of cv2.calcOpticalFlowFarneback(before, after, None, 0.5, 3, 15, 3, 5, 1.2, 0), by picture size: mean and deviation
of both directions, and the flow at three places; two, one and four levels of the pyramid, odd sizes."""


def grey(picture: np.ndarray) -> np.ndarray:
    return grey_levels(to_levels(picture))


@pytest.mark.parametrize("size", OPENCV)
def test_flow_is_that_of_opencv(size):
    truth = scene(*size)
    flow = optical_flow(grey(truth), grey(disturbed(truth, amount=0.02)))
    height, width = size
    found = [*flow.mean((0, 1)), *flow.std((0, 1)), *flow[0, 0], *flow[height // 2, width // 2]]
    assert [*found, flow[height // 3, width - 1, 0]] == pytest.approx(OPENCV[size], abs=2e-4)


def textured(size: tuple[int, int], shift: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    noise = np.random.default_rng(5).uniform(0, 255, (size[0] + 40, size[1] + 40))
    smooth = ndimage.gaussian_filter(noise, 3.0)
    smooth = 255 * (smooth - smooth.min()) / np.ptp(smooth)
    moved = ndimage.shift(smooth, shift, order=3, mode="nearest")
    return moved[20:-20, 20:-20].round().astype(np.uint8)


@pytest.mark.parametrize("shift", [(0.0, 3.0), (2.0, -1.5), (-6.0, 0.5)])
def test_what_moves_as_a_whole_has_its_shift_as_flow(shift):
    flow = optical_flow(textured((120, 160)), textured((120, 160), shift))
    inside = flow[20:-20, 20:-20].reshape(-1, 2)
    assert np.median(inside, 0)[::-1] == pytest.approx(shift, abs=0.1)
