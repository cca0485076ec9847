"""The .ply, byte by byte, and as Open3D reads it."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import numpy as np
import pytest

from engine.export.formats import ply
from tests.engine.export.scenes import chance_splats, one_splat


def test_names_order_and_values_are_those_of_3d_gaussian_splatting():
    file = io.BytesIO()
    ply.write(one_splat(quats=[[0.0, 0.6, 0.0, 0.8]]), file)
    head, _, body = file.getvalue().partition(b"end_header\n")
    lines = head.decode("ascii").split("\n")
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    assert "element vertex 1" in lines
    names = [line for line in lines if line.startswith("property")]
    assert names == [
        f"property float {name}"
        for name in (
            *("x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity"),
            *("scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"),
        )
    ]
    values = struct.unpack("<14f", body)
    dc = [(color - 0.5) / 0.28209479177387814 for color in (0.2, 0.5, 0.8)]
    expected = [0.5, -1.25, 3.0, *dc, 0.0, *np.log([0.01, 0.02, 0.04]), 0.0, 0.6, 0.0, 0.8]
    np.testing.assert_allclose(values, expected, rtol=1e-6, atol=1e-6)


def test_full_rows_are_those_of_the_reference_code():
    splats = chance_splats(70_000)  # more than are made at a time
    file = io.BytesIO()
    ply.write_full(splats, file)
    head, _, body = file.getvalue().partition(b"end_header\n")
    names = [line.rpartition(" ")[2] for line in head.decode("ascii").split("\n") if line.startswith("property float")]
    rest = [f"f_rest_{index}" for index in range(45)]
    assert names == [
        *("x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", *rest, "opacity"),
        *("scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"),
    ]
    assert len(body) == 248 * len(splats)
    rows = np.frombuffer(body, "<f4").reshape(-1, 62)
    assert not rows[:, 3:6].any()
    assert not rows[:, 9:54].any()
    usual = io.BytesIO()
    ply.write(splats, usual)
    few = np.frombuffer(usual.getvalue().partition(b"end_header\n")[2], "<f4").reshape(-1, 14)
    np.testing.assert_array_equal(np.delete(rows, [*range(3, 6), *range(9, 54)], axis=1), few)
    file.seek(0)
    usual.seek(0)
    found, same = ply.read(file), ply.read(usual)
    for name in ("means", "quats", "scales", "opacities", "colors"):
        np.testing.assert_array_equal(getattr(found, name), getattr(same, name))


def test_opacities_are_held_where_their_logit_is_finite():
    splats = chance_splats(2)
    splats.opacities[:] = (0.0, 1.0)
    file = io.BytesIO()
    ply.write(splats, file)
    rows = np.frombuffer(file.getvalue().partition(b"end_header\n")[2], "<f4").reshape(2, 14)
    np.testing.assert_allclose(rows[:, 6], [-13.8155, 13.8155], atol=1e-3)


@pytest.mark.parametrize("suffix", ["ply", "splat", "spz"])
def test_open3d_reads_the_same(tmp_path: Path, suffix: str):
    o3d = pytest.importorskip("open3d")
    from engine.export.formats.table import FORMATS

    splats = chance_splats(400)
    path = tmp_path / f"scene.{suffix}"
    with path.open("wb") as file:
        FORMATS[suffix].write(splats, file)
    with path.open("rb") as file:
        ours = FORMATS[suffix].read(file)
    cloud = o3d.t.io.read_point_cloud(str(path))
    np.testing.assert_allclose(cloud.point.positions.numpy(), ours.means, atol=1e-5)
    np.testing.assert_allclose(cloud.point["scale"].numpy(), ours.scales, rtol=1e-4)
    np.testing.assert_allclose(cloud.point["f_dc"].numpy(), ours.f_dc, atol=1e-4)
    found = cloud.point["rot"].numpy()
    np.testing.assert_allclose(np.abs((found * ours.quats).sum(1)), 1.0, atol=1e-2)
    np.testing.assert_allclose(1 / (1 + np.exp(-cloud.point["opacity"].numpy()[:, 0])), ours.opacities, atol=1e-5)


def test_open3d_reads_the_points_of_a_plain_reader(tmp_path: Path):
    o3d = pytest.importorskip("open3d")
    splats = chance_splats(100)
    path = tmp_path / "scene.ply"
    with path.open("wb") as file:
        ply.write(splats, file)
    np.testing.assert_array_equal(np.asarray(o3d.io.read_point_cloud(str(path)).points, np.float32), splats.means)
