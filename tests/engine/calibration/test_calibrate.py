"""The real child process of a calibration: what it says where there is nothing to see, and that it leaves no files."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest
from PIL import Image

from engine.calibration.calibrate import calibrate
from engine.calibration.options import CalibrationOptions
from engine.errors import PreparationError


@pytest.fixture
def scratch(tmp_path, monkeypatch) -> Path:
    """The temporary folder of this test."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    monkeypatch.setenv("TMPDIR", str(folder))  # of its child processes
    return folder


@pytest.mark.slow
def test_pictures_without_anything_in_them_say_what_is_missing(tmp_path: Path, scratch: Path) -> None:
    for name in ("a", "b", "c"):
        (tmp_path / "grey" / name).mkdir(parents=True)
        Image.new("RGB", (64, 48), (120, 120, 120)).save(tmp_path / "grey" / name / "0.png")
    with pytest.raises(PreparationError, match=r"No three cameras could be placed") as caught:
        calibrate(tmp_path / "grey", CalibrationOptions(), report=lambda _: None)
    assert "  a  b       0 matches\n" in caught.value.message
    assert "0 of 3 pairs have 30 matches or more" in caught.value.message
    assert "finely patterned" in caught.value.hint
    assert "Caliscope" in caught.value.hint
    assert not list(scratch.glob("clipgstream-*"))


def test_who_interrupts_it_leaves_no_files(tmp_path: Path, scratch: Path) -> None:
    for name in ("a", "b", "c"):
        (tmp_path / "grey" / name).mkdir(parents=True)
        Image.new("RGB", (64, 48)).save(tmp_path / "grey" / name / "0.png")

    def stop() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        calibrate(tmp_path / "grey", CalibrationOptions(), report=lambda _: None, alive=stop)
    assert not list(scratch.glob("clipgstream-*"))
