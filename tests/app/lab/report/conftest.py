"""A trained project whose report draws in no time."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from PIL import Image

from app.lab.report.paper_figures.crop_sheet import Sheet
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
        "paper_figures.change_maps": ("draw_change_maps",),
        "paper_figures.features": ("draw_picture_rows",),
        "paper_figures.over_length": ("draw_over_length",),
    }.items():
        for name in names:
            monkeypatch.setattr(f"app.lab.report.{module}.{name}", lambda *_args, **_options: buffer.getvalue())
    monkeypatch.setattr(
        "app.lab.report.paper_figures.crops.draw_crops", lambda *_args: Sheet(buffer.getvalue(), n_times=1)
    )


@pytest.fixture
def project(tmp_path: Path, capture_folder: Path, quick_charts: None) -> Path:
    return train(tmp_path / "p", capture_folder)
