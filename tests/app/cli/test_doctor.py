"""`clipgstream doctor` names what is missing, with the line that brings it."""

from __future__ import annotations

import importlib.metadata
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from app.cli import doctor
from app.cli.installing import system_libraries
from app.cli.installing.system_libraries import install_line, missing_packages

ROOT = Path(__file__).resolve().parents[3]
PIP = f"{shlex.quote(sys.executable)} -m pip install"


@pytest.fixture
def without(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Makes packages look as if they were not installed."""
    version = importlib.metadata.version

    def hide(*names: str) -> None:
        def found(name: str) -> str:
            if name in names:
                raise importlib.metadata.PackageNotFoundError(name)
            return "1.0" if name in doctor.PACKAGES else version(name)

        monkeypatch.setattr(doctor.importlib.metadata, "version", found)

    return hide


def test_a_missing_package_comes_with_its_line(without: Callable[..., None]) -> None:
    without("scipy", "av", "open3d")
    found, missing = doctor._packages()
    assert "open3d-cpu 1.0" in found.text
    assert not missing.is_fine
    assert missing.text == f"scipy, av. Run: {PIP} scipy av"


def test_a_missing_extra_is_named_but_no_fault(without: Callable[..., None]) -> None:
    without("ray", "usd-core")
    finding = doctor._extras()
    assert finding.is_fine
    assert f"{PIP} 'clipgstream[cluster]'" in finding.text
    assert f"no usd-core, for USD files ({PIP} 'clipgstream[usd]')" in finding.text


def test_a_missing_encoder_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    assert doctor._encoders().is_fine
    monkeypatch.setattr("app.export.video.formats._has_encoder", lambda codec: codec != "libvpx-vp9")
    finding = doctor._encoders()
    assert not finding.is_fine
    assert finding.text.startswith("FFmpeg lacks libvpx-vp9. ")


def test_missing_libraries_come_with_the_line_of_apt(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(system_libraries, "_loads", lambda name: name != "libEGL.so.1")
    monkeypatch.setattr(system_libraries, "DRIVER_FILES", ("nowhere/*.so",))
    assert missing_packages() == ["libegl1", "libgl1-mesa-dri"]
    finding = doctor._libraries()
    assert not finding.is_fine
    assert finding.text.endswith(install_line(["libegl1", "libgl1-mesa-dri"]))
    monkeypatch.setattr(sys, "platform", "darwin")
    assert missing_packages() == []
    assert doctor._libraries().is_fine


def test_libraries_can_be_asked_for_before_anything_is_installed() -> None:
    code = "from app.cli.installing.system_libraries import missing_packages; print(*missing_packages())"
    done = subprocess.run([sys.executable, "-S", "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
