"""Point clouds that come with captures: what is written is read, and what is damaged is refused in words."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from engine.capture.points import CapturePoints, read_points
from engine.capture.writers.point_files import write_colmap_points, write_ply
from engine.errors import CaptureError

POINTS = np.random.default_rng(2).normal(size=(50, 3))
COLORS = np.random.default_rng(3).integers(0, 256, (50, 3))
CLOUD = CapturePoints(POINTS, COLORS.astype(np.uint8))


def ascii_ply(folder: Path) -> Path:
    lines = ["ply", "format ascii 1.0", "comment by hand", "element vertex 50"]
    lines += ["property uchar red", "property float x", "property double y", "property uchar green"]
    lines += ["property float z", "property uchar blue", "element face 1", "property list uchar int vertex_indices"]
    lines += ["end_header"]
    lines += [
        f"{red} {float(x)!r} {float(y)!r} {green} {float(z)!r} {blue}"
        for (x, y, z), (red, green, blue) in zip(POINTS, COLORS, strict=True)
    ]
    (folder / "a.ply").write_text("\n".join([*lines, "3 0 1 2"]) + "\n")
    return folder / "a.ply"


def gaussian_ply(folder: Path) -> Path:
    """As of a trained scene: many properties, no plain colours."""
    names = ["x", "y", "z", "nx", "ny", "nz", *(f"f_dc_{i}" for i in range(3)), *(f"f_rest_{i}" for i in range(45))]
    rows = np.random.default_rng(4).normal(size=(50, len(names))).astype("<f4")
    rows[:, :3] = POINTS
    header = "ply\nformat binary_little_endian 1.0\nelement vertex 50\n"
    header += "".join(f"property float {name}\n" for name in names) + "end_header\n"
    (folder / "g.ply").write_bytes(header.encode() + rows.tobytes())
    return folder / "g.ply"


def binary_ply(folder: Path) -> Path:
    write_ply(folder / "b.ply", CLOUD)
    return folder / "b.ply"


def colmap_file(folder: Path, *, is_binary: bool) -> Path:
    write_colmap_points(folder, CLOUD, is_binary=is_binary)
    return folder / ("points3D.bin" if is_binary else "points3D.txt")


def npz(folder: Path, *, is_compressed: bool = False) -> Path:
    rows = np.column_stack([POINTS, COLORS / 255, np.ones(50)])
    (np.savez_compressed if is_compressed else np.savez)(folder / "init_pt_cld.npz", data=rows)
    return folder / "init_pt_cld.npz"


MAKERS: list[tuple[Callable[[Path], Path], bool]] = [
    (ascii_ply, True),
    (binary_ply, True),
    (gaussian_ply, False),
    (lambda folder: colmap_file(folder, is_binary=True), True),
    (lambda folder: colmap_file(folder, is_binary=False), True),
    (npz, True),
    (lambda folder: npz(folder, is_compressed=True), True),
]


@pytest.mark.parametrize(("make", "has_colors"), MAKERS)
def test_every_kind_of_file_is_read(tmp_path: Path, make: Callable[[Path], Path], has_colors: bool) -> None:
    cloud = read_points(make(tmp_path))
    assert np.allclose(cloud.points, POINTS, atol=1e-6)
    assert cloud.n_dropped == 0
    if has_colors:
        assert cloud.colors is not None
        assert np.array_equal(cloud.colors, COLORS)
    else:
        assert cloud.colors is None


def test_points_that_are_no_numbers_are_dropped_and_counted(tmp_path: Path) -> None:
    points = POINTS.copy()
    points[3, 1], points[7, 0], points[9, 2] = np.nan, np.inf, 1e20
    write_ply(tmp_path / "a.ply", CapturePoints(points, None))
    cloud = read_points(tmp_path / "a.ply")
    assert cloud.n_dropped == 3
    assert np.isfinite(cloud.points).all()
    assert len(cloud.points) == 47


@pytest.mark.parametrize(("make", "has_colors"), MAKERS)
def test_a_file_that_is_cut_off_is_refused(tmp_path: Path, make: Callable[[Path], Path], has_colors: bool) -> None:
    path = make(tmp_path)
    data = path.read_bytes()
    path.write_bytes(data[: int(0.6 * len(data))])
    with pytest.raises(CaptureError, match=path.name):
        read_points(path)


HEADER = (
    b"ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty float x\nproperty float y\nproperty float z\n"
)


@pytest.mark.parametrize(
    ("name", "data", "said"),
    [
        ("a.ply", b"", "not a PLY file"),
        ("a.ply", b"\x89PNG\r\n", "not a PLY file"),
        ("a.ply", b"ply\nformat ascii 1.0\n", "header is not complete"),
        ("a.ply", HEADER % 10**15 + b"end_header\n", "at most 20,000,000"),
        ("a.ply", HEADER % 10**6 + b"end_header\n", "announces 1000000 points"),
        ("a.ply", HEADER % 1 + b"property list uchar int x\nend_header\n" + b"\0" * 99, "property"),
        ("a.ply", HEADER % 1 + b"property float x\nend_header\n" + b"\0" * 99, "one twice"),
        ("a.ply", (HEADER % 1).replace(b"little", b"big") + b"end_header\n" + b"\0" * 12, "binary_big_endian"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement face 3\nelement vertex 2\nend_header\n", "not points"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n", "no x, y and z"),
        (
            "a.ply",
            (HEADER % 1).replace(b"binary_little_endian", b"ascii") + b"end_header\n1 2 x\n",
            "values that are not numbers",
        ),
        ("points3D.bin", b"\xff" * 8, "announces"),
        ("points3D.bin", b"\0" * 9, "left over"),
        ("points3D.txt", b"1 2 3\n", "no position and colour"),
        ("points3D.txt", b"1 a b c 1 2 3\n", "values that are not numbers"),
        ("points3D.txt", b"\x00" * 100, "no position and colour|values that are not numbers"),
        ("a.npz", b"PK\x03\x04", "not an archive"),
        ("a.npz", b"hello", "not an archive"),
        ("a.xyz", b"1 2 3", "not a supported point cloud"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, name: str, data: bytes, said: str) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(CaptureError, match=said):
        read_points(tmp_path / name)


def test_an_archive_that_unpacks_to_far_more_is_refused(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "a.npz", data=np.zeros((10**6, 3)))
    tracemalloc.start()
    try:
        with pytest.raises(CaptureError, match="would take 24,000,128 bytes"):
            read_points(tmp_path / "a.npz")
        assert tracemalloc.get_traced_memory()[1] < 1 << 20
    finally:
        tracemalloc.stop()


def test_arrays_of_objects_or_of_another_shape_are_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", data=np.array([None, {}], object))
    with pytest.raises(CaptureError, match="does not hold numbers"):
        read_points(tmp_path / "a.npz")
    np.savez(tmp_path / "b.npz", data=np.zeros(12))
    with pytest.raises(CaptureError, match="shape"):
        read_points(tmp_path / "b.npz")
    np.savez(tmp_path / "c.npz", points=np.zeros((4, 3)))
    with pytest.raises(CaptureError, match="no array called data"):
        read_points(tmp_path / "c.npz")


def test_missing_folders_and_pipes_are_refused(tmp_path: Path) -> None:
    import os

    os.mkfifo(tmp_path / "pipe.ply")
    (tmp_path / "folder.ply").mkdir()
    (tmp_path / "loop.ply").symlink_to(tmp_path / "loop.ply")
    for name in ("gone.ply", "pipe.ply", "folder.ply", "loop.ply"):
        with pytest.raises(CaptureError, match=name):
            read_points(tmp_path / name)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["ply", "bin", "txt"])
def test_no_more_memory_than_twice_the_file(tmp_path: Path, kind: str) -> None:
    points = np.random.default_rng(2).normal(size=(10_000, 3))
    cloud = CapturePoints(points, np.zeros((10_000, 3), np.uint8))
    if kind == "ply":
        path = tmp_path / "a.ply"
        write_ply(path, cloud)
    else:
        write_colmap_points(tmp_path, cloud, is_binary=kind == "bin")
        path = tmp_path / f"points3D.{kind}"
    tracemalloc.start()
    try:
        read_points(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 2 * path.stat().st_size + (1 << 20)
