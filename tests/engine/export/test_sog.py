"""The .sog, taken apart here without the writer's help."""

from __future__ import annotations

import io
import json
import zipfile

import numpy as np
import pytest
from PIL import Image

from engine.export.formats import sog
from engine.export.splats import Splats
from tests.engine.export.scenes import angles_deg, chance_splats, order_of


def taken_apart(splats: Splats) -> tuple[dict, dict[str, np.ndarray]]:
    file = io.BytesIO()
    assert sog.write(splats, file) == ()
    with zipfile.ZipFile(file) as archive:
        assert archive.testzip() is None
        assert all(info.compress_type == zipfile.ZIP_STORED for info in archive.infolist())
        meta = json.loads(archive.read("meta.json"))
        pictures = {}
        for name in archive.namelist():
            if name.endswith(".webp"):
                picture = Image.open(io.BytesIO(archive.read(name)))
                assert picture.format == "WEBP"
                pictures[name] = np.asarray(picture.convert("RGBA"))
    return meta, pictures


@pytest.mark.parametrize("n", [1, 16, 17, 1000])
def test_meta_and_pictures_are_those_of_version_2(n: int):
    meta, pictures = taken_apart(chance_splats(n))
    assert (meta["version"], meta["count"]) == (2, n)
    assert meta["means"]["files"] == ["means_l.webp", "means_u.webp"]
    assert set(pictures) == {"means_l.webp", "means_u.webp", "scales.webp", "quats.webp", "sh0.webp"}
    (shape,) = {picture.shape for picture in pictures.values()}
    height, width, _ = shape
    assert width % 4 == 0
    assert height % 4 == 0
    assert n <= width * height < n + 8 * width
    for key in ("scales", "sh0"):
        assert len(meta[key]["codebook"]) == 256
        assert np.isfinite(meta[key]["codebook"]).all()


def test_pixels_say_what_the_layout_says():
    splats = chance_splats(500)
    splats.opacities[:10] = 0.0  # colours of pixels that cannot be seen must stay
    meta, pictures = taken_apart(splats)
    pixels = {name: picture.reshape(-1, 4)[:500].astype(float) for name, picture in pictures.items()}
    shares = (pixels["means_l.webp"] + 256 * pixels["means_u.webp"])[:, :3] / 65535
    low, high = np.array(meta["means"]["mins"]), np.array(meta["means"]["maxs"])
    logs = low + shares * (high - low)
    means = np.sign(logs) * (np.exp(np.abs(logs)) - 1)
    with io.BytesIO() as file:
        sog.write(splats, file)
        file.seek(0)
        ours = sog.read(file)
    np.testing.assert_allclose(ours.means, means, atol=1e-5)
    source = splats[order_of(ours, splats)]
    np.testing.assert_allclose(means, source.means, atol=1e-4)
    codes = np.array(meta["scales"]["codebook"])[pixels["scales.webp"][:, :3].astype(int)]
    np.testing.assert_allclose(codes, np.log(source.scales), atol=0.02)
    colors = 0.5 + 0.28209479177387814 * np.array(meta["sh0"]["codebook"])[pixels["sh0.webp"][:, :3].astype(int)]
    np.testing.assert_allclose(colors, source.colors, atol=0.006)
    np.testing.assert_allclose(pixels["sh0.webp"][:, 3] / 255, source.opacities, atol=0.002)
    assert (source.opacities == 0.0).sum() == 10
    quats = np.zeros((500, 4))
    for row, (a, b, c, tag) in enumerate(pixels["quats.webp"]):
        others = [(1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2)][int(tag) - 252]
        quats[row, list(others)] = (np.array([a, b, c]) / 255 * 2 - 1) / np.sqrt(2)
        quats[row, int(tag) - 252] = np.sqrt(1 - (quats[row] ** 2).sum())
    assert angles_deg(quats, source.quats).max() < 0.9


def test_no_gaussians_are_a_small_picture():
    meta, pictures = taken_apart(chance_splats(0))
    assert meta["count"] == 0
    assert {picture.shape for picture in pictures.values()} == {(4, 4, 4)}
