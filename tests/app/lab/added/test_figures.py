"""What the lab adds to an evaluation: where tOF and LPIPS stand, why they are missing, and that they are kept."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import ndimage

from app.evaluation.evaluation import evaluate_project
from app.evaluation.headless import TrainedProject, open_trained
from app.lab.added import lpips
from app.lab.added.figures import COLUMNS, with_added_figures
from app.lab.flicker import FLOW_FIGURES, flicker_figures
from app.project.opening.project_access import open_project
from engine.metrics.pictures.colors import to_levels
from tests.app.fakes import write_capture
from tests.app.lab.report.made_up import Measure, change_header, train

SIZE = (96, 64)


class Pictures:
    """Renders stand still; what the camera takes moves to the right by a pixel a frame."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, int]] = []
        noise = np.random.default_rng(5).uniform(0, 1, (SIZE[1], SIZE[0] + 20, 3))
        smooth = ndimage.gaussian_filter(noise, (3, 3, 0))
        self._wide = ((smooth - smooth.min()) / np.ptp(smooth)).astype(np.float32)

    def pair(self, clip_index, frame_index, camera, features="both"):
        self.asked.append((camera, frame_index))
        moved = np.roll(self._wide, frame_index, 1)
        return to_levels(moved[:, 10:-10]), self._wide[:, 10:-10]

    def changes(self, frame_index, camera):
        raise NotImplementedError

    def covered(self, clip_index):
        raise NotImplementedError


@pytest.fixture
def opened(tmp_path: Path) -> TrainedProject:
    project = train(tmp_path / "p", write_capture(tmp_path / "capture", size=SIZE))
    return open_trained(open_project(project, is_writable=False))


def evaluation(opened: TrainedProject, metrics: Any = "all") -> dict[str, Any]:
    return evaluate_project(
        opened, clip_indices=[0, 1], metrics=metrics, on_progress=lambda *_: None, measuring=Measure()
    )


def test_pairs_of_held_out_cameras_have_tof_and_it_is_kept(opened):
    pictures, told = Pictures(), []
    document = with_added_figures(
        evaluation(opened), opened, pictures, on_progress=lambda done, n: told.append((done, n))
    )
    pairs = {(row["camera"], row["frame_index"]): row["tof"] for row in document["seams"]["rows"]}
    assert {camera for (camera, _), value in pairs.items() if value is not None} == {"0"}
    found = [pairs["0", frame] for frame in range(1, 6)]
    assert found == pytest.approx([1.0] * 5, rel=0.25)
    means = document["seams"]["means"]
    assert means["held_out"]["tof"] == pytest.approx(np.mean(found))
    assert means["held_out"]["boundary"]["tof"] == found[2]
    assert means["trained_on"]["tof"] is None
    expected = [np.mean(found), np.mean([*found[:2], *found[3:]]), found[2]]
    figures_of_pairs = flicker_figures(document["seams"]["rows"])
    assert [figures_of_pairs[name] for name in FLOW_FIGURES] == pytest.approx(expected)
    assert told == [(n, 6) for n in range(1, 7)]
    assert with_added_figures(evaluation(opened), opened, pictures) == document
    assert len(pictures.asked) == 6, "measured once"
    change_header(opened.project.clip_path(1), fingerprint="another")
    with_added_figures(evaluation(opened), opened, pictures)
    assert len(pictures.asked) == 12


def test_the_quick_choice_stays_as_it_is(opened):
    pictures = Pictures()
    document = with_added_figures(evaluation(opened, "quick"), opened, pictures)
    assert document == evaluation(opened, "quick")
    assert not pictures.asked
    assert [flicker_figures(document["seams"]["rows"])[name] for name in FLOW_FIGURES] == [None, None, None]


def test_lpips_stands_in_rows_means_and_columns(opened, monkeypatch):
    monkeypatch.setattr(lpips, "why_missing", lambda: None)
    monkeypatch.setattr(lpips, "lpips", lambda image, truth: 0.25)
    monkeypatch.setattr(lpips, "lpips_unscaled", lambda image, truth: 0.5)
    document = with_added_figures(evaluation(opened), opened, Pictures())
    held_out, means = dict(zip(COLUMNS, (0.25, 0.25, 0.5), strict=True)), document["means"]
    for row in document["rows"]:
        assert {name: row[name] for name in COLUMNS} == (held_out if row["is_held_out"] else dict.fromkeys(COLUMNS))
    for part in (means["all"], means["held_out"], means["clips"]["1"]["held_out"]):
        assert {name: part[name] for name in COLUMNS} == held_out
    assert means["trained_on"]["lpips"] is None
    assert (document["columns"]["lpips"]["n_rows"], document["columns"]["lpips"]["n_missing"]) == (6, 18)
