"""A project with a made clip of any number of Gaussians, for measuring a window without training anything."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from app.document.project_settings import ProjectSettings
from app.project.opening.project_access import create_project
from engine.capture.capture import open_capture
from engine.clip_files.clip_state import ClipState, write_clip_state
from tests.app.fakes import decoder_arrays
from tests.clip_headers import DECODER, make_header

FILL = 0.25
"""Radius of the ball of Gaussians, as a share of the way from the cameras to what they look at."""


def make_scene(folder: Path, capture_path: Path, n_gaussians: int) -> Path:
    """A project of the capture whose first clip is a hollow ball of Gaussians. Returns its folder.

    Surfaces, as in trained clips: with more Gaussians each is smaller, and about as many lie over each pixel.
    """
    capture = open_capture(capture_path)
    n_frames = capture.n_frames
    settings = ProjectSettings(capture=str(capture_path), fingerprint=capture.fingerprint, clip_length=n_frames)
    project = create_project(folder, settings)
    focus = capture.rig.focus_point()
    radius = FILL * float(np.linalg.norm(capture.rig.centers - focus, axis=1).mean())
    random = np.random.default_rng(0)
    directions = random.normal(size=(n_gaussians, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    positions = focus + radius * directions * random.uniform(0.8, 1.2, (n_gaussians, 1))
    size = 3.0 * radius / np.sqrt(n_gaussians)
    arrays = {
        "sets.static.positions": positions.astype(np.float32),
        "sets.static.color_logits": random.normal(scale=1.5, size=(n_gaussians, 3)).astype(np.float32),
        "sets.static.features": np.zeros((n_gaussians, DECODER["static_dim"]), np.float32),
        "sets.static.log_offset_scales": np.full((n_gaussians, 3), -4.0, np.float32),
        "sets.static.log_base_scales": np.full((n_gaussians, 3), np.log(2.0 * size), np.float32),
    }
    header = make_header(clip_length=n_frames, n_frames=n_frames, n_anchors={"static": n_gaussians}, near_plane=0.05)
    state = ClipState(arrays | decoder_arrays() | {"gains": np.ones((0, 3), np.float32)}, header).stamped()
    path = project.clip_path(0)
    path.parent.mkdir(exist_ok=True)
    write_clip_state(path, state)
    project.close()
    return folder
