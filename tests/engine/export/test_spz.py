"""The .spz, byte by byte, and what it cannot store as it is."""

from __future__ import annotations

import gzip
import io
import struct

import numpy as np
import pytest

from engine.errors import ProjectError
from engine.export.formats import spz
from tests.engine.export.scenes import chance_splats, one_splat


def unzipped(splats, n_notes: int = 0) -> bytes:
    file = io.BytesIO()
    assert len(spz.write(splats, file)) == n_notes
    return gzip.decompress(file.getvalue())


def test_planes_of_one_gaussian():
    data = unzipped(one_splat(quats=[[0.1, -0.7, 0.7, 0.1]], scales=[[0.02, 0.05, 0.1]]))
    assert len(data) == 16 + 20
    magic, version, n, degree, bits, flags, reserved = struct.unpack("<IIIBBBB", data[:16])
    assert (magic, version, n, degree, bits, flags, reserved) == (0x5053474E, 3, 1, 0, 12, 0, 0)
    planes = data[16:]
    positions = [int.from_bytes(planes[3 * i : 3 * i + 3], "little", signed=True) for i in range(3)]
    assert positions == [round(value * 4096) for value in (0.5, -1.25, 3.0)]
    assert planes[9] == round(0.5 * 255 + 1e-9)
    coefficients = [(color - 0.5) / 0.28209479177387814 for color in (0.2, 0.5, 0.8)]
    assert list(planes[10:13]) == [int(value * 0.15 * 255 + 0.5 * 255 + 0.5) for value in coefficients]
    assert list(planes[13:16]) == [round((np.log(scale) + 10) * 16) for scale in (0.02, 0.05, 0.1)]
    packed = int.from_bytes(planes[16:20], "little")
    # of x y z w = -0.7 0.7 0.1 0.1 the first is the largest, so all signs change: y, z and w are left
    assert packed >> 30 == 0
    for shift, value in ((20, -0.7), (10, -0.1), (0, -0.1)):
        part = packed >> shift & 1023
        assert part >> 9 == (value < 0)
        assert part & 511 == round(abs(value) / np.sqrt(0.5) * 511)


def test_a_small_scene_gets_finer_steps():
    splats = chance_splats(50, extent=0.01)
    splats.scales[:] = 2e-4
    file = io.BytesIO()
    assert spz.write(splats, file) == ()
    file.seek(0)
    assert gzip.decompress(file.getvalue())[13] > 12
    np.testing.assert_allclose(spz.read(file).means, splats.means, atol=2e-4 / 16)


def test_beyond_2048_units_steps_grow_and_that_is_said():
    splats = chance_splats(200, extent=30_000.0)
    splats.scales[:] = 20.0
    file = io.BytesIO()
    (note,) = spz.write(splats, file)
    assert "steps of 1/256" in note
    file.seek(0)
    np.testing.assert_allclose(spz.read(file).means, splats.means, atol=0.5 / 256 + 0.002)


def test_the_largest_position_of_12_bits_is_stored():
    splats = one_splat(means=[[2047.99, -2047.99, 0.0]])
    data = unzipped(splats)
    assert data[13] == 12
    np.testing.assert_allclose(spz.read(io.BytesIO(gzip.compress(data))).means, splats.means, atol=1 / 4096)


def test_positions_that_do_not_fit_are_an_error():
    with pytest.raises(ProjectError, match=r"1e\+07 scene units, and SPZ stores at most 8388607"):
        spz.write(one_splat(means=[[1e7, 0.0, 0.0]]), io.BytesIO())


@pytest.mark.parametrize(("scale", "said"), [(1000.0, "larger than 379"), (1e-6, "thinner than 4.5e-05")])
def test_sizes_that_do_not_fit_are_held_and_that_is_said(scale: float, said: str):
    file = io.BytesIO()
    (note,) = spz.write(one_splat(scales=[[scale, scale, scale]]), file)
    assert said in note
    file.seek(0)
    found = spz.read(file).scales
    assert np.isfinite(found).all()
    assert (found > 0).all()


def test_a_file_that_announces_too_much_is_refused():
    head = struct.pack("<IIIBBBB", 0x5053474E, 3, 2**32 - 1, 0, 12, 0, 0)
    with pytest.raises(ProjectError, match="cannot be read"):
        spz.read(io.BytesIO(gzip.compress(head)))
    other = struct.pack("<IIIBBBB", 0x5053474E, 4, 0, 0, 12, 0, 0)
    with pytest.raises(ProjectError, match="version 3"):
        spz.read(io.BytesIO(gzip.compress(other)))
