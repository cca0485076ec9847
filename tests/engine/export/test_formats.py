"""Every format gives back what was written, as near as it promises, and takes scenes at its edges."""

from __future__ import annotations

import io

import numpy as np
import pytest

from engine.errors import ProjectError
from engine.export.formats.table import FORMATS, Format
from engine.export.splats import Splats
from tests.engine.export.scenes import angles_deg, chance_splats, one_splat, order_of, round_trip

NEAR = {
    # centre in units, share of the scale, opacity, colour, angle in degrees
    "ply": (0.0, 1e-5, 1e-5, 1e-6, 0.05),
    "glb": (0.0, 1e-6, 1e-6, 1e-6, 0.05),
    "spz": (0.5 / 4096 + 1e-6, 0.032, 0.002, 0.0038, 0.25),
    "splat": (0.0, 1e-6, 0.002, 0.002, 1.2),
    "sog": (6e-5, 0.02, 0.002, 0.006, 0.9),
    "compressed-ply": (0.0025, 0.006, 0.002, 0.002, 0.25),
}


@pytest.fixture(params=FORMATS)
def name(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def kind(name: str) -> Format:
    return FORMATS[name]


def check(found: Splats, splats: Splats, name: str) -> None:
    """Check that each row is as near as the format promises."""
    assert len(found) == len(splats)
    splats = splats[order_of(found, splats)]
    mean, scale, opacity, color, angle = NEAR[name]
    np.testing.assert_allclose(found.means, splats.means, rtol=1e-6, atol=mean)
    np.testing.assert_allclose(np.log(found.scales), np.log(splats.scales), atol=scale)
    np.testing.assert_allclose(found.opacities, splats.opacities, atol=opacity)
    np.testing.assert_allclose(found.colors, splats.colors, atol=color)
    assert angles_deg(found.quats, splats.quats).max(initial=0.0) < angle
    np.testing.assert_allclose(np.linalg.norm(found.quats, axis=1), 1.0, atol=1e-3)


@pytest.mark.parametrize("n", [0, 1, 2, 255, 256, 257, 3000])
def test_what_was_written_is_read(name: str, kind: Format, n: int):
    splats = chance_splats(n, seed=n)
    check(round_trip(kind, splats), splats, name)


def test_equal_scenes_are_equal_files(kind: Format):
    files = [io.BytesIO(), io.BytesIO()]
    for file in files:
        kind.write(chance_splats(300), file)
    assert files[0].getvalue() == files[1].getvalue()


def test_bytes_are_about_what_is_forecast(kind: Format):
    file = io.BytesIO()
    kind.write(chance_splats(20_000), file)
    # numbers drawn by chance are packed worst
    assert 0.9 * kind.bytes_each < len(file.getvalue()) / 20_000 < 1.4 * kind.bytes_each


def test_opacities_of_0_and_1(name: str, kind: Format):
    splats = chance_splats(64)
    splats.opacities[:32], splats.opacities[32:] = 0.0, 1.0
    found = round_trip(kind, splats)
    np.testing.assert_allclose(found.opacities, splats.opacities[order_of(found, splats)], atol=1e-5)


def test_everything_in_one_place(kind: Format):
    splats = chance_splats(700)
    splats.means[:] = (0.25, -3.0, 17.0)
    found = round_trip(kind, splats)
    np.testing.assert_allclose(found.means, splats.means, rtol=1e-4)


def test_equal_gaussians(name: str, kind: Format):
    splats = one_splat()[np.zeros(300, np.int64)]
    check(round_trip(kind, splats), splats, name)


@pytest.mark.parametrize("scale", [5e-5, 300.0])
def test_tiny_and_huge_gaussians(kind: Format, scale: float):
    splats = chance_splats(100)
    splats.scales[:] = scale
    found = round_trip(kind, splats)
    np.testing.assert_allclose(found.scales, scale, rtol=0.035)


def test_places_far_away(kind: Format):
    splats = chance_splats(500, extent=1500.0)
    splats.scales[:] = 5.0
    found = round_trip(kind, splats)
    np.testing.assert_allclose(found.means, splats.means[order_of(found, splats)], atol=1.6)


def test_a_colour_beyond_its_range_is_kept_or_held(kind: Format):
    found = round_trip(kind, one_splat(colors=[[1.01, -0.005, 0.5]]))
    np.testing.assert_allclose(found.colors, [[1.01, -0.005, 0.5]], atol=0.012)


def test_other_files_are_refused(kind: Format):
    file = io.BytesIO()
    kind.write(chance_splats(300), file)
    data = file.getvalue()
    for damaged in (data[: len(data) // 2 + 1], data[:9], b"\x89PNG" + data[4:]):
        if kind.suffix == ".splat" and len(damaged) % 32 == 0:
            continue  # it has no head: any 32 bytes are a Gaussian
        with pytest.raises(ProjectError, match="cannot be read"):
            kind.read(io.BytesIO(damaged))


@pytest.mark.slow
def test_a_scene_of_300_000_gaussians(name: str, kind: Format):
    splats = chance_splats(300_000, extent=20.0)
    found = round_trip(kind, splats)
    assert len(found) == 300_000
    for column in ("means", "scales", "opacities", "colors"):
        old, new = getattr(splats, column), getattr(found, column)
        np.testing.assert_allclose(new.mean(0), old.mean(0), atol=2e-3)
        np.testing.assert_allclose(new.std(0), old.std(0), rtol=5e-3)
