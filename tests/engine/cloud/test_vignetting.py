"""Vignetting found from points: the lenses that made the observations, and nothing where there are none."""

import numpy as np
import pytest

from engine.camera.rig import CameraRig
from engine.cloud.background.vignetting import measure_vignetting, point_radii
from tests.engine.cloud.test_gains_range import ring_rig

N_CAMERAS, N_POINTS = 12, 4000
LENSES = np.array([[-0.35, 0.1]] * 8 + [[0.0, 0.0]] * 4)


@pytest.fixture(scope="module")
def rig() -> CameraRig:
    return ring_rig(N_CAMERAS)


def observed(rig: CameraRig, lenses: np.ndarray, *, gloss: float = 0.0, seed: int = 0):
    """Points and log(colour + 1) of what cameras with these lenses see of them, with noise and wrong matches."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1.2, 1.2, (N_POINTS, 3))
    colors = rng.uniform(40.0, 180.0, (N_POINTS, 3))
    squared = point_radii(points, rig).astype(np.float64)
    gains = rng.uniform(0.85, 1.15, (N_CAMERAS, 3))
    seen = colors * gains[:, None] * np.exp(squared * lenses[:, :1] + squared**2 * lenses[:, 1:])[..., None]
    seen *= np.exp(rng.normal(0.0, 0.02, seen.shape))
    seen *= np.exp(gloss * rng.normal(0.0, 1.0, (N_CAMERAS, N_POINTS, 1)))
    is_wrong = rng.random((N_CAMERAS, N_POINTS)) < 0.1
    seen[is_wrong] *= rng.uniform(0.5, 1.5, (int(is_wrong.sum()), 1))
    seen[rng.random((N_CAMERAS, N_POINTS)) < 0.3] = np.nan
    seen[squared > 1.0] = np.nan
    return points, np.log(seen + 1.0).astype(np.float32)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_lenses_are_found(rig: CameraRig, seed: int):
    found = measure_vignetting(*observed(rig, LENSES, seed=seed), rig)
    at = np.array([0.0, 0.2, 0.4, 0.6])
    fall, true = (lens[:, :1] * at + lens[:, 1:] * at**2 for lens in (found.coefficients, LENSES))
    # 1,900 points a camera scatter by 2 %, and a common rim is told from the scene by the same points
    np.testing.assert_allclose(fall, true, atol=0.01)
    assert "corrected" in found.text
    assert "not corrected" not in found.text


@pytest.mark.parametrize("gloss", [0.0, 0.1])
def test_cameras_without_vignetting_are_left_alone(rig: CameraRig, gloss: float):
    found = measure_vignetting(*observed(rig, np.zeros((N_CAMERAS, 2)), gloss=gloss), rig)
    assert (found.coefficients == 0).all()
    assert found.text.endswith("not corrected")


def test_light_from_one_side_is_not_taken_for_a_lens(rig: CameraRig):
    points, log_colors = observed(rig, np.zeros((N_CAMERAS, 2)))
    shade = 0.2 * np.linspace(-1, 1, N_CAMERAS)[:, None] * points[:, 0]  # depends on the camera, on one axis
    found = measure_vignetting(points, log_colors + shade[..., None].astype(np.float32), rig)
    assert (found.coefficients == 0).all()


def test_a_camera_that_saw_little_is_like_the_median(rig: CameraRig):
    points, log_colors = observed(rig, LENSES)
    log_colors[3, 50:] = np.nan
    found = measure_vignetting(points, log_colors, rig).coefficients
    others = np.delete(np.arange(N_CAMERAS), 3)
    assert any(np.array_equal(found[3], found[other]) for other in others)


def test_too_little_is_said(rig: CameraRig):
    points, log_colors = observed(rig, LENSES)
    found = measure_vignetting(points[:20], log_colors[:, :20], rig)
    assert (found.coefficients == 0).all()
    assert "too little" in found.text
    nothing = measure_vignetting(points[:0], log_colors[:, :0], rig)
    assert (nothing.coefficients == 0).all()
