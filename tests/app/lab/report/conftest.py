"""A trained project whose report draws in no time."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from PIL import Image

from tests.app.lab.report.made_up import train


@pytest.fixture
def quick_charts(monkeypatch: pytest.MonkeyPatch) -> None:
    """For tests that look at words and numbers only."""
    buffer = io.BytesIO()
    Image.new("RGB", (2, 2)).save(buffer, "png")
    for module, names in {
        "measured": ("draw_over_time", "draw_pictures"),
        "over_clips": ("draw_over_time",),
        "length": ("draw_over_time",),
        "seam_parts": ("draw_over_time", "draw_maps"),
        "costs": ("draw_stacked",),
        "comparison": ("draw_speed_error",),
    }.items():
        for name in names:
            monkeypatch.setattr(f"app.lab.report.{module}.{name}", lambda *_args: buffer.getvalue())


@pytest.fixture
def project(tmp_path: Path, capture_folder: Path, quick_charts: None) -> Path:
    return train(tmp_path / "p", capture_folder)
