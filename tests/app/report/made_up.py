"""Reports without training and rendering: evaluations of made-up rows, fake pictures, a page's reader."""

from __future__ import annotations

import random
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np

from app.project import create_project, default_settings
from app.report.write import write_report
from engine.capture.capture import open_capture
from engine.metrics import seams, summary
from engine.metrics.columns import COLUMNS
from engine.metrics.seams import PairRow, SeamMaps
from engine.metrics.summary import EvalRow
from engine.model.clip_state import ClipState, read_clip_state, write_clip_state
from tests.app.fakes import N_STEPS, FakeTraining

ODD_NAME = "a <i>&\"'$x$ é"
CAMERAS = ("0", "1", "2", "3")


class Measure:
    """Stands in for evaluate_project: made-up figures, real means; counts how often it is asked."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, str]] = []

    def __call__(self, opened, *, clip_indices, metrics="all", precision="float", on_progress) -> dict[str, Any]:
        self.asked.append((opened.project.folder.name, metrics))
        draw = random.Random(len(opened.project.folder.name)).random
        rows, pairs = [], []
        for clip_index in clip_indices:
            for frame in opened.clips[clip_index].frame_indices():
                for camera in CAMERAS:
                    missing = {name: "no network here" for name in COLUMNS if name.startswith("lpips")}
                    if metrics == "quick":
                        missing = {name: "quick choice" for name, c in COLUMNS.items() if not c.is_quick}
                    figures = {
                        name: None if name in missing else (20.0 if column.unit == "dB" else 0.0) + draw()
                        for name, column in COLUMNS.items()
                    }
                    rows.append(
                        EvalRow(clip_index, frame, camera, camera in opened.project.settings.holdout, figures, missing)
                    )
                    if frame > 0 and (frame != opened.clips[clip_index].start or clip_index - 1 in clip_indices):
                        pairs.append(
                            PairRow(
                                frame, clip_index, camera, camera in opened.project.settings.holdout,
                                frame == opened.clips[clip_index].start,
                                *(draw() * 0.01 for _ in range(6)), static_share=0.9,
                            )
                        )  # fmt: skip
        on_progress(len(rows), len(rows), rows[-1])
        return {
            "schema": 1,
            "holdout": list(opened.project.settings.holdout),
            "clips": list(clip_indices),
            "metrics": metrics,
            "precision": precision,
            "columns": summary.columns_of(rows),
            "rows": [row.as_dict() for row in rows],
            "means": {
                "all": summary.means(rows),
                **summary.by_group(rows),
                "clips": {str(i): summary.by_group([r for r in rows if r.clip_index == i]) for i in clip_indices},
                "cameras": summary.by_camera(rows),
                "frames": summary.by_frame(rows),
                "worst": summary.worst_by_group(rows),
            },
            "seams": {"rows": [pair.as_dict() for pair in pairs], **seams.summarize(pairs)},
        }


class FakePictures:
    """Noise of the capture's size."""

    def __init__(self, opened) -> None:
        self._rng = np.random.default_rng(0)

    def pair(self, clip_index, frame_index, camera):
        return self._rng.integers(0, 255, (24, 32, 3), dtype=np.uint8), self._rng.random((24, 32, 3), np.float32)

    def seam(self, clip_index, camera):
        change, truth = self._rng.random((2, 24, 32), np.float32) * 0.1
        return SeamMaps(change, truth, np.maximum(change - truth, 0), truth < 0.05)


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


def change_header(path: Path, change: Callable[[dict[str, Any]], None]) -> None:
    state = read_clip_state(path)
    change(state.header)
    write_clip_state(path, ClipState(state.arrays, state.header))


def report(project: Path, measure: Callable[..., dict[str, Any]] | None = None, **options: Any) -> Path:
    stages: list[str] = []
    page = write_report(
        project,
        measure=measure or Measure(),
        make_pictures=FakePictures,
        on_stage=lambda stage, done, n: stages.append(stage),
        **options,
    )
    assert "Drawing" in stages
    return page
