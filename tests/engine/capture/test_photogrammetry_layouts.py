"""Cameras of Metashape and RealityCapture that are left out, cannot be said in our terms, or are damaged."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from engine.capture.capture import open_capture
from engine.errors import CaptureError
from tests.engine.capture.layouts.tables import TABLES


def metashape(folder: Path) -> Path:
    TABLES["metashape-opencv5"](folder)
    return folder / "cameras.xml"


def realitycapture(folder: Path) -> Path:
    TABLES["realitycapture-opencv5"](folder)
    return folder / "cam2.xmp"


@pytest.mark.parametrize("word", ["false", "0"])
def test_what_is_not_aligned_or_switched_off_is_left_out(tmp_path: Path, word: str) -> None:
    path = metashape(tmp_path)
    text = path.read_text()
    path.write_text(
        text.replace('component_id="7" label="cam10.jpg"', f'component_id="7" label="cam10.jpg" enabled="{word}"')
    )
    capture = open_capture(tmp_path)
    assert capture.rig.names == ("cam1", "cam2", "cam11")
    said = "Videos of which the calibration has no camera are left out: videos/cam10.mp4."
    assert said in capture.warnings


@pytest.mark.parametrize(
    ("write", "pattern", "instead", "said"),
    [
        (metashape, r"</calibration></sensor>", "<k4>0.001</k4></calibration></sensor>", "k4 = 0.001"),
        (metashape, r"</calibration></sensor>", "<p3>0.001</p3></calibration></sensor>", "p3 and p4"),
        (metashape, r'type="frame" class="adjusted"', 'type="fisheye" class="adjusted"', "of the type fisheye"),
        (metashape, r'(class="adjusted">.{0,60})<f>[^<]*</f>', r"\1", "has no f"),
        (metashape, r"<f>[^<]*</f>", "<f>wide</f>", "not a number"),
        (metashape, r"(<transform>)[-\d.e]+", r"\1nan", "NaN"),
        (metashape, r"(<transform>)[-\d.e]+ ", r"\1", "has 15 numbers, not 16"),
        (metashape, r'sensor_id="\d"', 'sensor_id="77"', "no calibration"),
        (realitycapture, r"brown3t2", "division", "the model division"),
        (realitycapture, r"(Coeficients>\S+ \S+ \S+) 0 ", r"\1 0.5 ", "k4 = 0.5"),
        (realitycapture, r'FocalLength35mm="[^"]*"', 'FocalLength35mm="-3"', "must be positive"),
        (realitycapture, r"<xcr:Position>\S+ ", "<xcr:Position>", "has 2 numbers, not 3"),
        (realitycapture, r"</x:xmpmeta>", "", "not XML"),
    ],
)
def test_what_cannot_be_said_names_the_camera_and_the_reason(
    tmp_path: Path, write: Callable[[Path], Path], pattern: str, instead: str, said: str
) -> None:
    path = write(tmp_path)
    text, n_changed = re.subn(pattern, instead, path.read_text())
    assert n_changed
    path.write_text(text)
    with pytest.raises(CaptureError, match=re.escape(said)):
        open_capture(tmp_path)


def test_other_xml_and_the_metadata_of_photographs_are_no_calibrations(tmp_path: Path) -> None:
    path = metashape(tmp_path)
    path.write_text("<document><body/></document>")
    (tmp_path / "photo.xmp").write_text("<x:xmpmeta><rdf:RDF><rdf:Description Rating='5'/></rdf:RDF></x:xmpmeta>")
    with pytest.raises(CaptureError, match="not a capture"):
        open_capture(tmp_path)


def test_what_is_cut_off_or_has_no_camera_in_place_is_said(tmp_path: Path) -> None:
    path = metashape(tmp_path / "m")
    path.write_text(path.read_text()[:900])
    with pytest.raises(CaptureError, match=r"cameras.xml, of which the file is not XML .* that cannot be read"):
        open_capture(path.parent)
    path.write_text(re.sub(r"<transform>[-+.e\d ]+</transform>", "", metashape(tmp_path / "m").read_text()))
    with pytest.raises(CaptureError, match=r"No calibrated camera is in it.*placed and switched on"):
        open_capture(path.parent)


def test_a_camera_without_frames_is_left_out_and_named(tmp_path: Path) -> None:
    realitycapture(tmp_path)
    (tmp_path / "cam10.mp4").unlink()
    capture = open_capture(tmp_path)
    assert capture.rig.names == ("cam1", "cam2", "cam11")
    assert any("cam10" in warning for warning in capture.warnings)
    assert not any(warning.startswith("Videos of which") for warning in capture.warnings)
