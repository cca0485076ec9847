"""Rotations of quaternions against scipy's."""

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from engine.backends.reference.raster import rotation_matrices


def test_quaternions_of_any_length_are_rotations(rng):
    quats = rng.normal(size=(50, 4))  # w, x, y, z
    expected = Rotation.from_quat(np.roll(quats, -1, axis=1)).as_matrix()
    for length in (1e-3, 1.0, 1e3):
        found = rotation_matrices(torch.from_numpy(quats * length))
        assert np.allclose(found.numpy(), expected, atol=1e-12)
