"""USD over time: what was written comes back to the last bit, and transforms of other programs are followed."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from engine.errors import ProjectError
from engine.export.sequences import usd
from engine.export.sequences.sequence import SequenceTiming
from engine.export.sequences.table import SEQUENCES
from engine.export.usd_library import writing_usd
from tests.engine.export.made_sequence import FPS, N_FRAMES, STRETCH_FRAMES, MadeSequence
from tests.engine.export.scenes import order_of


def test_without_the_library_the_remedy_is_said(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "pxr.Tf", None)
    with pytest.raises(ProjectError, match=r"pip install 'clipgstream\[usd\]'"):
        SEQUENCES["usd"].check()


def modules(*names: str) -> list[Any]:
    """Of the library."""
    return [importlib.import_module(f"pxr.{name}") for name in names]


@pytest.fixture(scope="module", params=[".usdc", ".usda"])
def path(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file of the made sequence."""
    pytest.importorskip("pxr")
    path = tmp_path_factory.mktemp("usd") / f"made{request.param}"
    usd.write(MadeSequence().stretches(), SequenceTiming(N_FRAMES, FPS), path)
    return path


def test_every_frame_comes_back(path: Path):
    reader, made = usd.UsdReader(path), MadeSequence()
    assert reader.timing == SequenceTiming(N_FRAMES, FPS)
    for frame in (0, 11, 12, 35):
        found, live = reader.splats(frame), made.frame(frame)
        assert len(found) == len(live)
        live = live[order_of(found, live)]
        for name in ("means", "quats", "scales", "opacities", "colors"):
            np.testing.assert_allclose(getattr(found, name), getattr(live, name), atol=1e-5)
    reader.close()


def test_the_stage_is_one_that_programs_understand(path: Path):
    Usd, UsdGeom = modules("Usd", "UsdGeom")
    stage = Usd.Stage.Open(str(path))
    assert stage.GetTimeCodesPerSecond() == FPS
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0.0, N_FRAMES - 1.0)
    fields = [prim for prim in stage.Traverse() if prim.GetTypeName() == "ParticleField3DGaussianSplat"]
    assert len(fields) == 1 + 1 + N_FRAMES // STRETCH_FRAMES  # moving, shared, and those of each stretch
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    n_shown = [
        sum(UsdGeom.Imageable(prim).ComputeVisibility(frame) == "inherited" for prim in fields) for frame in range(36)
    ]
    assert set(n_shown) == {3}


@pytest.mark.parametrize(("said", "written"), [(None, 1.0), (0.01, 0.01)])
def test_a_stage_says_how_long_its_unit_is(tmp_path: Path, said: float | None, written: float):
    pytest.importorskip("pxr")
    Usd, UsdGeom = modules("Usd", "UsdGeom")
    timing = SequenceTiming(N_FRAMES, FPS, meters_per_unit=said)
    usd.write(MadeSequence().stretches(), timing, tmp_path / "unit.usda")
    stage = Usd.Stage.Open(str(tmp_path / "unit.usda"))
    assert UsdGeom.StageHasAuthoredMetersPerUnit(stage)
    assert UsdGeom.GetStageMetersPerUnit(stage) == written


def test_a_turned_and_scaled_prim_lies_where_the_stage_has_it(path: Path):
    Gf, Usd, UsdGeom = modules("Gf", "Usd", "UsdGeom")
    live = usd.UsdReader(path).splats(3)
    stage = Usd.Stage.Open(str(path))
    where = UsdGeom.Xformable(stage.GetPrimAtPath(usd.ROOT))
    turn = Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(0, 0, 1), 90)) * Gf.Matrix4d().SetScale(2.0)
    where.AddTransformOp().Set(turn * Gf.Matrix4d().SetTranslate(Gf.Vec3d(10, 0, 0)))
    moved = path.with_stem("moved")
    stage.GetRootLayer().Export(str(moved))
    found = usd.UsdReader(moved).splats(3)
    expected = 2.0 * live.means[:, [1, 0, 2]] * [-1, 1, 1] + [10, 0, 0]
    np.testing.assert_allclose(found.means, expected, atol=1e-4)
    np.testing.assert_allclose(found.scales, 2.0 * live.scales, rtol=1e-4)


def test_the_way_up_comes_from_the_stage(path: Path):
    Usd, UsdGeom = modules("Usd", "UsdGeom")
    assert usd.UsdReader(path).splats(0).up == (0.0, 1.0, 0.0)
    stage = Usd.Stage.Open(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    turned = path.with_stem("turned")
    stage.GetRootLayer().Export(str(turned))
    assert usd.UsdReader(turned).splats(0).up == (0.0, 0.0, 1.0)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("radiance:sphericalHarmonicsDegree = 0", "radiance:sphericalHarmonicsDegree = -1"),
        ("int radiance:sphericalHarmonicsDegree = 0", 'string radiance:sphericalHarmonicsDegree = "x"'),
        ("point3f[] positions = [(0, 0, 0)]", 'string[] positions = ["a"]'),
    ],
)
def test_values_of_another_type_are_refused(tmp_path: Path, name: str, value: str):
    pytest.importorskip("pxr")
    lines = (
        "point3f[] positions = [(0, 0, 0)]",
        "quatf[] orientations = [(1, 0, 0, 0)]",
        "float3[] scales = [(1, 1, 1)]",
        "float[] opacities = [0.5]",
        "float3[] radiance:sphericalHarmonicsCoefficients = [(0, 0, 0)]",
        "int radiance:sphericalHarmonicsDegree = 0",
    )
    text = '#usda 1.0\ndef ParticleField3DGaussianSplat "a" {\n' + "\n".join(lines) + "\n}\n"
    (tmp_path / "good.usda").write_text(text)
    assert len(usd.UsdReader(tmp_path / "good.usda").splats(0)) == 1
    (tmp_path / "bad.usda").write_text(text.replace(name, value))
    with pytest.raises(ProjectError, match="of another type"):
        usd.UsdReader(tmp_path / "bad.usda").splats(0)


def test_where_nothing_can_be_written_the_reason_is_one_line(tmp_path: Path):
    pytest.importorskip("pxr")
    (tmp_path / "file").write_text("")
    (Usd,) = modules("Usd")
    with pytest.raises(OSError, match=r"^USD: [^\n]+$"), writing_usd():
        Usd.Stage.CreateNew(str(tmp_path / "file" / "a.usda"))


def test_bad_files_are_refused(path: Path, tmp_path: Path):
    (Usd,) = modules("Usd")
    for name, data in (("cut.usdc", path.read_bytes()[:300]), ("no.usdc", b"no"), ("no.usda", b"#usda 9.0\n)")):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(ProjectError, match="cannot be read"):
            usd.UsdReader(tmp_path / name)
    Usd.Stage.CreateNew(str(tmp_path / "empty.usda")).Save()
    with pytest.raises(ProjectError, match="no prim"):
        usd.UsdReader(tmp_path / "empty.usda")
