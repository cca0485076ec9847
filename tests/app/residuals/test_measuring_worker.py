"""The process that measures, without a process: the figures of `eval`, in the order of what the user looks at."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from app.evaluation.evaluation import evaluate_project
from app.evaluation.headless import open_trained
from app.project.opening.project_access import open_project
from app.residuals import measuring_worker
from app.residuals.figures import ClipMeasurements, Figures
from app.residuals.heat_map import LEVELS
from app.residuals.kept_reading import read_kept
from app.residuals.measuring_messages import (
    Command,
    Event,
    LookAt,
    MeasureJob,
    PictureMeasured,
    SetShare,
    Trouble,
)
from app.residuals.measuring_order import MeasuringFocus, first_item
from app.residuals.measuring_worker import Talk, measure
from engine.children.messages import decoded, encoded
from engine.clip_files.clip_state import read_clip_state
from tests.app.residuals.conftest import color

FOCUS = MeasuringFocus()


class Heard:
    """Takes down what is said; looks elsewhere after so many pictures."""

    def __init__(self, look: MeasuringFocus = FOCUS, *, then: MeasuringFocus | None = None, after: int = 0) -> None:
        self.look: MeasuringFocus = look
        self._then, self._after = then, after
        self.events: list[Event] = []
        self.n_rests = 0

    def send(self, event) -> None:
        self.events.append(decoded(encoded(event), Event))

    def say(self, message: str) -> None:
        self.send(Trouble(message))

    def rest(self) -> None:
        self.n_rests += 1
        if self._then is not None and len(self.events) == self._after:
            self.look = self._then

    @property
    def measured(self) -> list[PictureMeasured]:
        return [event for event in self.events if isinstance(event, PictureMeasured)]

    @property
    def rows(self) -> list[tuple[int, int]]:
        """frame and camera of the rows, in order."""
        return [(e.row.frame_index, e.row.camera_index) for e in self.measured if e.row is not None]


def job_of(project: Path, *, trained=(0, 1), is_kept: bool = True, rows=None, pairs=None) -> MeasureJob:
    settings = open_project(project, is_writable=False).settings
    everything = np.ones((6, 4), bool)
    later = everything.copy()
    later[0] = False
    return MeasureJob(
        project=str(project),
        capture=settings.capture,
        scale=1.0,
        frames=None,
        follow_links=False,
        trained=trained,
        rows=everything if rows is None else rows,
        pairs=later if pairs is None else pairs,
        is_kept=is_kept,
        look=MeasuringFocus(),
    )


def figures_of(project: Path, heard: Heard) -> Figures:
    opened = open_trained(open_project(project, is_writable=False))
    figures = Figures(opened.clips, 4)
    figures.set_trained([0, 1])
    for event in heard.measured:
        rows, pairs = () if event.row is None else (event.row,), () if event.pair is None else (event.pair,)
        figures.take(ClipMeasurements(event.clip_index, rows, pairs))
    while figures.has_stale_seams:
        figures.score_seams()
    return figures


def nothing_left(*_: object, **__: object) -> Any:
    raise AssertionError("something is measured again")


def test_figures_are_those_of_eval_and_eval_takes_them_up(project):
    heard = Heard()
    measure(job_of(project), heard)
    figures = figures_of(project, heard)
    opened = open_trained(open_project(project, is_writable=False))
    document = evaluate_project(
        opened, clip_indices=[0, 1], on_progress=lambda *_: None, say=nothing_left, measuring=nothing_left
    )
    names = opened.capture.rig.names
    assert figures.n_done == figures.n_all == 24
    for row in document["rows"]:
        at = row["frame_index"], names.index(row["camera"])
        assert (figures.cells["psnr"][at], figures.cells["flip"][at]) == (row["psnr"], row["flip"])
    for pair in document["seams"]["rows"]:
        at = pair["frame_index"], names.index(pair["camera"])
        share = pair["static_share"]
        mean = share * (pair["excess_static"] or 0.0) + (1 - share) * (pair["excess_moving"] or 0.0)
        assert figures.cells["E"][at] == pytest.approx(LEVELS * mean)
    assert np.isnan(figures.cells["E"][0]).all()
    (seam,), (boundary,) = figures.seams, document["seams"]["boundaries"]
    assert (seam.clip_index, seam.frame_index) == (1, boundary["frame_index"])
    assert seam.score == pytest.approx(boundary["score"], abs=1e-12)
    assert seam.ratio == pytest.approx(boundary["ratio_static"])
    assert seam.worst_camera is not None
    assert names[seam.worst_camera] == boundary["worst_camera"]
    assert seam.n_cameras == sum(found["score"] is not None for found in boundary["cameras"].values())
    read = Figures(opened.clips, 4)
    for found in read_kept(opened, [0, 1], [0, 1], nothing_left):
        read.take(found)
    for column, values in figures.cells.items():
        np.testing.assert_array_equal(values, read.cells[column])


@pytest.mark.slow
def test_without_keeping_nothing_is_written(project):
    heard = Heard()
    measure(job_of(project, is_kept=False), heard)
    assert len(heard.rows) == 24
    assert not (project / "evaluations").exists()


def test_only_what_is_not_known_is_measured(project):
    rows, pairs = np.zeros((6, 4), bool), np.zeros((6, 4), bool)
    rows[4, 2] = pairs[3, 1] = True
    heard = Heard()
    measure(job_of(project, rows=rows, pairs=pairs), heard)
    assert heard.rows == [(4, 2)]
    assert [e.pair.frame_index for e in heard.measured if e.pair is not None] == [3]


@pytest.mark.slow
def test_what_the_user_looks_at_comes_first_even_in_the_middle(project):
    heard = Heard(MeasuringFocus(0, 2), then=MeasuringFocus(1, 3), after=2)
    measure(job_of(project), heard)
    order = list(dict.fromkeys((frame // 3, camera) for frame, camera in heard.rows))
    assert order[0] == (0, 2)
    assert order[1] == (1, 3), "at once, not after the clip that was begun"
    assert len(heard.rows) == 24 == len(set(heard.rows))


class Retraining(Heard):
    """A clip is trained again before its first picture is measured."""

    def __init__(self, path: Path) -> None:
        super().__init__(MeasuringFocus(1))
        self._path: Path | None = path

    def send(self, event) -> None:
        super().send(event)
        if self._path is not None:
            reference = read_clip_state(self._path.with_name("0000.safetensors")).header.fingerprint
            color(self._path, seed=8, reference=reference)
            self._path = None


def test_figures_of_one_version_are_not_kept_under_the_name_of_another(project, monkeypatch):
    monkeypatch.setattr(measuring_worker, "MAX_CLIPS", 1)  # everything is read again and again
    path = project / "clips" / "0001.safetensors"
    heard = Retraining(path)
    measure(job_of(project), heard)
    assert {0, 1, 2} <= {frame for frame, _ in heard.rows}
    opened = open_trained(open_project(project, is_writable=False))
    kept = list(read_kept(opened, [0, 1], [1], nothing_left))
    assert [found.rows for found in kept] == [[]]
    assert not [event for event in heard.events if isinstance(event, Trouble)]


def test_a_damaged_clip_costs_itself_alone(project):
    path = project / "clips" / "0001.safetensors"
    content = bytearray(path.read_bytes())
    content[-20] ^= 0xFF
    path.write_bytes(content)
    heard = Heard()
    measure(job_of(project), heard)
    assert {frame for frame, _ in heard.rows} == {0, 1, 2}
    assert any("0001.safetensors" in event.message for event in heard.events if isinstance(event, Trouble))


class Losing(Heard):
    """The files of a camera are gone once something was measured."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self._folder = folder

    def rest(self) -> None:
        super().rest()
        for file in self._folder.iterdir():
            file.unlink()


def test_a_camera_whose_pictures_are_gone_costs_itself_alone(project):
    settings = open_project(project, is_writable=False).settings
    lost = _camera_named(project, "3")
    heard = Losing(Path(settings.capture) / "ims" / "3")
    measure(job_of(project), heard)
    assert {camera for _, camera in heard.rows} == {0, 1, 2, 3} - {lost}
    assert any(isinstance(event, Trouble) for event in heard.events)


def _camera_named(project: Path, name: str) -> int:
    return open_trained(open_project(project, is_writable=False)).capture.rig.names.index(name)


def test_order():
    holdout = {5}
    items = {(clip, camera) for clip in range(4) for camera in range(6)}
    order = []
    while (item := first_item(items, MeasuringFocus(1, 3), holdout)) is not None:
        order.append(item)
        items.discard(item)
    assert order[:2] == [(1, 3), (1, 5)]
    assert {clip for clip, _ in order[:8]} == {0, 1, 2, 3}, "the held-out camera of all clips before the other cameras"
    assert {camera for _, camera in order[:8]} == {3, 5}
    assert [clip for clip, _ in order[8:12]] == [1, 1, 1, 1]


class FakeParent:
    """A clock that passes while it is waited for messages."""

    def __init__(self, *messages: tuple[float, Command]) -> None:
        self.now_s, self.cpu_s = 100.0, 0.0
        self._messages = list(messages)

    def receive(self, wait_s: float) -> Command | None:
        if self._messages and self._messages[0][0] <= self.now_s + wait_s:
            self.now_s = max(self.now_s, self._messages[0][0])
            return self._messages.pop(0)[1]
        self.now_s += wait_s
        return None


def talk_of(project, monkeypatch, parent: FakeParent) -> Talk:
    monkeypatch.setattr(measuring_worker.time, "monotonic", lambda: parent.now_s)
    monkeypatch.setattr(measuring_worker.time, "process_time", lambda: parent.cpu_s)
    return Talk(job_of(project), cast(Any, parent))


def test_while_a_clip_trains_it_rests_nineteen_times_as_long_as_it_computes(project, monkeypatch):
    parent = FakeParent((100.0, SetShare(0.05)))
    talk = talk_of(project, monkeypatch, parent)
    talk.rest()
    assert parent.now_s == 100.0
    parent.cpu_s += 2.0
    talk.rest()
    assert parent.now_s == pytest.approx(138.0)
    talk.rest()
    assert parent.now_s == pytest.approx(138.0), "what it did before is paid for"


def test_the_rest_ends_when_the_training_does_and_commands_are_heard_in_it(project, monkeypatch):
    parent = FakeParent((100.0, SetShare(0.05)), (103.0, LookAt(MeasuringFocus(1, 2))), (110.0, SetShare(1.0)))
    talk = talk_of(project, monkeypatch, parent)
    parent.cpu_s += 2.0
    talk.rest()
    assert parent.now_s == pytest.approx(110.0)
    assert talk.look == MeasuringFocus(1, 2)
