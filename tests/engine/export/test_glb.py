"""The .glb against the rules of glTF 2.0 and of KHR_gaussian_splatting, taken apart here without the writer's help."""

from __future__ import annotations

import io
import json
import struct
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from engine.errors import ProjectError
from engine.export.formats import glb
from engine.export.splats import Splats
from engine.export.world import AXES, world
from tests.engine.export.scenes import chance_splats, one_splat

WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
KINDS = {5121: np.dtype("u1"), 5123: np.dtype("<u2"), 5126: np.dtype("<f4")}
PREFIX = "KHR_gaussian_splatting:"
REQUIRED = {
    "POSITION": ("VEC3", 5126),
    f"{PREFIX}ROTATION": ("VEC4", 5126),
    f"{PREFIX}SCALE": ("VEC3", 5126),
    f"{PREFIX}OPACITY": ("SCALAR", 5126),
    f"{PREFIX}SH_DEGREE_0_COEF_0": ("VEC3", 5126),
}


def taken_apart(splats: Splats) -> tuple[dict[str, Any], bytes]:
    """The document and the buffer, with the rules of the container checked."""
    file = io.BytesIO()
    glb.write(splats, file)
    data = file.getvalue()
    magic, version, length = struct.unpack("<4sII", data[:12])
    assert (magic, version, length) == (b"glTF", 2, len(data))
    n_json, kind = struct.unpack("<I4s", data[12:20])
    assert kind == b"JSON"
    assert n_json % 4 == 0
    text = data[20 : 20 + n_json]
    document = json.loads(text)
    assert text.rstrip(b" ").endswith(b"}")  # filled up with spaces
    rest = data[20 + n_json :]
    if not rest:
        return document, b""
    n_bin, kind = struct.unpack("<I4s", rest[:8])
    assert kind == b"BIN\0"
    assert n_bin % 4 == 0
    assert n_bin == len(rest) - 8
    return document, rest[8:]


def attributes_of(document: dict[str, Any], data: bytes) -> dict[str, np.ndarray]:
    """Attributes as numbers, with the rules of accessors and views checked."""
    (buffer,) = document["buffers"]
    assert "uri" not in buffer
    assert buffer["byteLength"] <= len(data) < buffer["byteLength"] + 4
    (mesh,) = document["meshes"]
    (primitive,) = mesh["primitives"]
    found = {}
    for name, index in primitive["attributes"].items():
        accessor = document["accessors"][index]
        view = document["bufferViews"][accessor["bufferView"]]
        kind, width = KINDS[accessor["componentType"]], WIDTHS[accessor["type"]]
        assert view["buffer"] == 0
        assert view["target"] == 34962
        assert view["byteOffset"] % 4 == 0
        assert (kind.itemsize * width) % 4 == 0
        assert view["byteLength"] == accessor["count"] * kind.itemsize * width
        assert view["byteOffset"] + view["byteLength"] <= buffer["byteLength"]
        values = np.frombuffer(data, kind, accessor["count"] * width, view["byteOffset"]).reshape(-1, width)
        if accessor.get("normalized"):
            assert kind != KINDS[5126]
            values = values / np.iinfo(kind).max
        found[name] = values
    assert len({len(values) for values in found.values()}) == 1
    return found


def test_it_follows_the_rules_of_the_extension():
    splats = chance_splats(333)
    document, data = taken_apart(splats)
    assert document["asset"]["version"] == "2.0"
    assert document["extensionsUsed"] == ["KHR_gaussian_splatting"]
    assert "extensionsRequired" not in document  # without the extension there are points
    primitive = document["meshes"][0]["primitives"][0]
    assert primitive["mode"] == 0
    extension = primitive["extensions"]["KHR_gaussian_splatting"]
    assert extension == {"kernel": "ellipse", "colorSpace": "srgb_rec709_display"}
    for name, (kind, component) in REQUIRED.items():
        accessor = document["accessors"][primitive["attributes"][name]]
        assert (accessor["type"], accessor["componentType"]) == (kind, component)
    found = attributes_of(document, data)
    position = document["accessors"][primitive["attributes"]["POSITION"]]
    np.testing.assert_array_equal(np.float32(position["min"]), found["POSITION"].min(0))
    np.testing.assert_array_equal(np.float32(position["max"]), found["POSITION"].max(0))
    assert np.abs(np.linalg.norm(found[f"{PREFIX}ROTATION"], axis=1) - 1.0).max() < 1e-5
    assert (found[f"{PREFIX}SCALE"] > 0.0).all()
    assert ((found[f"{PREFIX}OPACITY"] >= 0.0) & (found[f"{PREFIX}OPACITY"] <= 1.0)).all()


def test_values_are_activated_and_rotations_end_with_w():
    splats = one_splat(quats=[[0.1, 0.7, 0.7, -0.1]])
    document, data = taken_apart(splats)
    found = attributes_of(document, data)
    np.testing.assert_allclose(found["POSITION"], [[0.5, -1.25, 3.0]])
    np.testing.assert_allclose(found[f"{PREFIX}ROTATION"], [[0.7, 0.7, -0.1, 0.1]], rtol=1e-6)
    np.testing.assert_allclose(found[f"{PREFIX}SCALE"], [[0.01, 0.02, 0.04]])
    np.testing.assert_allclose(found[f"{PREFIX}OPACITY"], [[0.5]])
    coefficients = [[(color - 0.5) / 0.28209479177387814 for color in (0.2, 0.5, 0.8)]]
    np.testing.assert_allclose(found[f"{PREFIX}SH_DEGREE_0_COEF_0"], coefficients, atol=1e-6)
    linear = [((color + 0.055) / 1.055) ** 2.4 for color in (0.2, 0.5, 0.8)]  # of sRGB
    np.testing.assert_allclose(found["COLOR_0"], [[*linear, 0.5]], atol=0.5 / 255 + 1e-6)


@pytest.mark.parametrize("up", [None, *sorted(AXES)])
def test_the_scene_stands_upright_in_gltf(up: str | None):
    scene_up = np.array([0.1, -0.9, 0.3])
    splats = world(scene_up, up=up).placed(chance_splats(10))
    document, _ = taken_apart(splats)
    (node,) = document["nodes"]
    turned = Rotation.from_quat(node["rotation"]).apply(splats.up)
    np.testing.assert_allclose(turned, [0.0, 1.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(node["rotation"]), 1.0, atol=1e-9)


def test_more_than_4_gib_are_an_error(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(glb, "_MOST_BYTES", 5000)
    with pytest.raises(ProjectError, match="100 Gaussians are more than"):
        glb.write(chance_splats(100), io.BytesIO())


def test_no_gaussians_are_an_empty_scene():
    document, data = taken_apart(chance_splats(0))
    assert data == b""
    assert not {"nodes", "meshes", "accessors", "bufferViews", "buffers", "extensionsUsed"} & set(document)
    assert document["scenes"] == [{}]
