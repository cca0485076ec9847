"""exposure_span: drift is seen in the middle of a clip before it is trained; what cannot be known is not said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from safetensors.numpy import load_file

from engine.training.config import TrainConfig
from engine.training.plan.exposure_span import exposure_span
from engine.training.preparation.cloud_preparation import BACKGROUNDS_FILE
from tests.engine.training.tiny_training import SIZES


class Pictures:
    """Frames by a function of camera."""

    def __init__(self, picture):
        self._picture = picture

    def frames(self, camera_index, frame_indices):
        for _ in frame_indices:
            yield self._picture(camera_index)


@pytest.fixture
def span(tiny):
    """Of clip 1 of the tiny capture, had the cameras taken their backgrounds at other gains."""
    cameras = [camera for camera in range(len(tiny.capture.rig)) if camera not in tiny.holdout]
    backgrounds = dict(zip(cameras, load_file(tiny.prep_dir / BACKGROUNDS_FILE)["images"], strict=True))

    def run(gains=(), prep_dir=tiny.prep_dir, **settings):
        def picture(camera):
            gain = gains[cameras.index(camera)] if cameras.index(camera) < len(gains) else 1.0
            return np.clip(backgrounds[camera] * gain + 0.5, 0, 255).astype(np.uint8)

        capture = replace(tiny.capture, store=Pictures(picture))
        return exposure_span(capture, tiny.clips[1], cameras, TrainConfig(**(SIZES | settings)), prep_dir)

    return run


def test_the_span_is_that_of_the_cameras(span):
    low, high = span(gains=(0.92, 1.06))
    assert low == pytest.approx(-0.08, abs=0.006)
    assert high == pytest.approx(0.06, abs=0.006)


def test_no_drift_is_none(span):
    assert span() == (0.0, 0.0)


def test_nothing_is_said_without_backgrounds_or_where_exposure_does_not_count(span, tmp_path):
    assert span(prep_dir=tmp_path) is None
    assert span(color="off") is None
