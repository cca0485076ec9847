"""Reports without training and rendering: evaluations of made-up rows, fake pictures, a page's reader."""

from __future__ import annotations

import io
import random
import zlib
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from app.evaluation.evaluation import EvaluationScope, Frames
from app.evaluation.headless import TrainedProject
from app.lab.report.paper_figures.crop_sheet import Sheet
from app.lab.report.write import write_report
from app.playback.modes.coverage import CoveredSpace
from app.project.opening.project_access import create_project, default_settings
from engine.capture.capture import open_capture
from engine.clip_files.clip_state import read_clip_state, write_clip_state
from engine.metrics.clips.seams import PairRow, SeamMaps
from engine.metrics.clips.summary import EvalRow
from engine.metrics.columns import COLUMNS
from tests.app.fakes import N_STEPS, FakeTraining
from tests.clip_headers import with_header

ODD_NAME = "a <i>&\"'$x$ é"
CAMERAS = ("0", "1", "2", "3")


class Measure:
    """Stands in for app.evaluation.evaluation.ClipMeasuring: made-up figures; says what it was asked for.

    Attributes:
        asked: Project, choice of metrics and clip, in order.
        n_rows: Rows that it gave.
    """

    def __init__(self) -> None:
        self.asked: list[tuple[str, str, int]] = []
        self.n_rows = 0

    def __call__(
        self, opened: TrainedProject, scope: EvaluationScope, clip_index: int, unknown: Frames
    ) -> Iterator[EvalRow | PairRow]:
        self.asked.append((opened.project.folder.name, scope.metrics, clip_index))
        draw = random.Random(len(opened.project.folder.name) + clip_index).random
        for camera_index, (frames, pairs) in unknown.items():
            camera = CAMERAS[camera_index]
            is_held_out = camera in opened.project.settings.holdout
            for frame in frames:
                missing = {name: "too small here" for name in COLUMNS if name.startswith("dssim_ms")}
                if scope.metrics == "quick":
                    missing = {name: "quick choice" for name, c in COLUMNS.items() if not c.is_quick}
                figures = {
                    name: None if name in missing else (20.0 if column.unit == "dB" else 0.0) + draw()
                    for name, column in COLUMNS.items()
                }
                self.n_rows += 1
                yield EvalRow(clip_index, frame, camera, is_held_out, figures, missing)
            for frame in pairs:
                is_boundary = frame == opened.clips[clip_index].start
                yield self.pair(
                    PairRow(
                        frame, clip_index, camera, is_held_out, is_boundary,
                        *(draw() * 0.01 for _ in range(6)), static_share=0.9,
                    )
                )  # fmt: skip

    def pair(self, row: PairRow) -> PairRow:
        """The values of a pair; tests change them."""
        return row


class FakePictures:
    """Noise of the capture's size: the same for the same question, other renders for other projects."""

    def __init__(self, opened: TrainedProject) -> None:
        self._name = opened.project.folder.name

    def pair(self, clip_index, frame_index, camera, features="both"):
        truth = _noise(frame_index, camera).integers(0, 255, (24, 32, 3), dtype=np.uint8)
        return truth, _noise(frame_index, camera, self._name, features).random((24, 32, 3), np.float32)

    def changes(self, frame_index, camera):
        truth = _noise(frame_index, camera).random((24, 32), np.float32) * 0.1
        change = _noise(frame_index, camera, self._name).random((24, 32), np.float32) * 0.1
        return SeamMaps(change, truth, np.maximum(change - truth, 0), truth < 0.05)

    def covered(self, clip_index):
        places = _noise(clip_index).random((20, 3), np.float32)
        return CoveredSpace(places[:12], np.full(12, 0.1, np.float32), places[12:], places[12:, 0] - 0.3, clip_index)


def _noise(*what: object) -> np.random.Generator:
    return np.random.default_rng(zlib.crc32(repr(what).encode("utf-8", "replace")))


class Page(HTMLParser):
    """Reads a page and sees to it that every element is closed where it has to be."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.tables: dict[str, list[list[str]]] = {}
        self.text, self._table = "", ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        name = tag
        self.tags.append((name, dict(attrs)))
        assert len(attrs) == len(dict(attrs)), f"an attribute stands twice in {name}"
        if name in ("img", "meta"):
            return
        self.open.append(name)
        if name == "table":
            self._table = str(dict(attrs)["id"]).removeprefix("table-")
            self.tables[self._table] = []
        elif name == "tr" and "tbody" in self.open:
            self.tables[self._table].append([])
        elif name == "td":
            self.tables[self._table][-1].append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if "style" not in self.open:
            self.text += data
        if "td" in self.open:
            self.tables[self._table][-1][-1] += data

    def attributes(self, name: str) -> list[dict[str, str | None]]:
        return [attributes for found, attributes in self.tags if found == name]


def train(
    folder: Path, capture: Path, *, n_clips: int = 2, holdout: tuple[str, ...] = ("0",), **overrides: object
) -> Path:
    """A project with finished clips of three frames, without times."""
    opened = open_capture(capture)
    project = create_project(folder, default_settings(opened, clip_length=3, holdout=holdout, overrides=overrides))
    reference = None
    for clip in project.clips(opened.n_frames)[:n_clips]:
        training = FakeTraining(opened, clip, reference, lambda progress: None)
        for _ in range(N_STEPS):
            training.step()
        write_clip_state(project.clip_path(clip.clip_index), training.state())
        reference = reference or training.state()
    project.close()
    return folder


def change_header(path: Path, **entries: Any) -> None:
    write_clip_state(path, with_header(read_clip_state(path), **entries))


def report(project: Path, measure: Measure | None = None, **options: Any) -> Path:
    stages: list[str] = []
    page = write_report(
        project,
        measuring=measure or Measure(),
        make_pictures=FakePictures,
        on_stage=lambda stage, done, n: stages.append(stage),
        **options,
    )
    assert "Drawing" in stages
    return page


def draw_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reports without charts, for tests that look at words and numbers only."""
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
        "paper_figures.spheres": ("draw_spheres",),
        "paper_figures.over_length": ("draw_over_length",),
    }.items():
        for name in names:
            monkeypatch.setattr(f"app.lab.report.{module}.{name}", lambda *_args, **_options: buffer.getvalue())
    monkeypatch.setattr(
        "app.lab.report.paper_figures.crops.draw_crops", lambda *_args: Sheet(buffer.getvalue(), n_times=1)
    )
