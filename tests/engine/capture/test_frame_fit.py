"""Frames of another size than their calibration: scaled, or cropped at a side that only the user knows."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from engine.capture.capture import open_capture
from engine.capture.pixels.frame_fit import FrameFit, OtherSize
from engine.capture.writers.capture_json import Corrections, write_corrections
from engine.errors import CaptureError
from tests.engine.capture.layouts import written_toml
from tests.engine.capture.layouts.scene import make_scene

K = np.array([[1681.0, 0, 533], [0, 1682, 948], [0, 0, 1]])
SIZE = (240, 136)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A capture of 240x136 whose calibration says 242x136, as H.264 pads."""
    scene = make_scene(lens="opencv5", size=SIZE)
    written_toml.write(tmp_path, scene, has_times=False)
    path = tmp_path / "Calib_scene.toml"
    path.write_text(path.read_text().replace("size = [240, 136]", "size = [242, 136]"))
    return tmp_path


@pytest.mark.parametrize(
    ("frames", "cut"),
    [
        ((1080, 1920), (8, 0)),
        ((540, 960), (4, 0)),  # made smaller and cropped
        ((544, 960), (0, 0)),
        ((1088, 1920), (0, 0)),
        ((362, 640), (0, 0)),  # 362.67, rounded to an even number
        ((1088, 1900), (0, 20)),
    ],
)
def test_a_copy_of_another_size_is_told_from_another_shape(frames: tuple[int, int], cut: tuple[float, float]) -> None:
    assert np.allclose(OtherSize(K, (1088, 1920)).cut_px(frames), cut)


@pytest.mark.parametrize(
    ("fit", "focal", "centre"),
    [
        ("scaled", 1681 * 1080 / 1088, 533 * 1080 / 1088),
        ("cropped_end", 1681, 533),
        ("cropped_start", 1681, 525),
        ("cropped_middle", 1681, 529),
    ],
)
def test_the_principal_point_goes_with_what_was_cut_off(fit: FrameFit, focal: float, centre: float) -> None:
    fitted = OtherSize(K, (1088, 1920)).fitted_K((1080, 1920), fit)
    assert np.allclose(fitted, [[focal, 0, centre], [0, 1682, 948], [0, 0, 1]])
    half = OtherSize(K, (1088, 1920)).fitted_K((540, 960), fit)
    assert np.allclose(half[:2], fitted[:2] / 2)
    copy = OtherSize(K, (1088, 1920)).fitted_K((544, 960), fit)
    assert np.allclose(copy[:2], K[:2] / 2)  # nothing was cut off, whatever was said of others


def test_another_shape_is_warned_about_with_numbers_until_something_is_said(folder: Path) -> None:
    before = open_capture(folder)
    (warning,) = (text for text in before.warnings if "another shape" in text)
    assert "cam1 240x136, calibrated at 242x136" in warning
    assert "if they were cropped, that is wrong by up to 2 px at the border" in warning
    assert before.layout.misfit_px == 2
    write_corrections(before.layout, folder, Corrections(fit="cropped_start"))
    after = open_capture(folder)
    assert not any("if they were cropped" in text for text in after.warnings)
    assert any("which were cropped at the left and upper border" in text for text in after.warnings)
    scale = 240 / 242
    for old, new in zip(before.layout.cameras, after.layout.cameras, strict=True):
        assert np.isclose(new.K[0, 0], old.K[0, 0] / scale)
        assert np.isclose(new.K[0, 2], old.K[0, 2] / scale - 2)
        assert np.allclose(new.K[1], old.K[1])
    write_corrections(after.layout, folder, Corrections(fit="scaled"))  # and back again: nothing is lost
    again = open_capture(folder)
    assert again.layout.fit == "scaled"
    assert np.allclose([entry.K for entry in again.layout.cameras], [entry.K for entry in before.layout.cameras])


def test_other_corrections_leave_it_open(folder: Path) -> None:
    write_corrections(open_capture(folder).layout, folder, Corrections(holdout=["cam2"]))
    assert "fit" not in json.loads((folder / "capture.json").read_text())
    assert any("if they were cropped" in text for text in open_capture(folder).warnings)


def test_a_very_different_shape_opens_only_where_something_is_said(folder: Path) -> None:
    path = folder / "Calib_scene.toml"
    write_corrections(open_capture(folder).layout, folder, Corrections(fit="cropped_end"))
    document = json.loads((folder / "capture.json").read_text())
    for row in document["cameras"]:
        row["height"] = 200
    (folder / "capture.json").write_text(json.dumps(document))
    assert open_capture(folder).layout.misfit_px > 60
    path.write_text(path.read_text().replace("size = [242, 136]", "size = [242, 200]"))
    (folder / "capture.json").unlink()
    with pytest.raises(CaptureError, match=r"its calibration is for 242x200\.[\s\S]*inspect --fit"):
        open_capture(folder)
    asked = open_capture(folder, is_shape_asked=True)
    assert len(asked.layout.far_off) == len(asked.rig)
    write_corrections(asked.layout, folder, Corrections(fit="scaled"))
    squeezed = open_capture(folder)
    assert not squeezed.layout.far_off
    assert np.allclose([entry.K for entry in squeezed.layout.cameras], [entry.K for entry in asked.layout.cameras])
