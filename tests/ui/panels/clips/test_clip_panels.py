"""Words and entries about clips in panels, menus and dialogs; hatching of painted masks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from app.project.disk.use import ClipUse, DiskUse
from app.session.clips.clip_commands import AskFreeSpace, CompareVersion, MergeClips, SplitClip
from app.session.clips.clip_questions import CutQuestion, DamagedQuestion, RoomQuestion
from app.session.exclusions.exclusion_commands import ExcludeCameras, PaintMask
from app.session.training.train_commands import TrainStale
from app.status import ClipStatus, QueueStatus, SequenceForecast, VersionStatus
from engine.capture.exclusions import Stroke
from tests.ui.fake_session import FakeSession
from tests.ui.pilot import Pilot
from ui.panels.clips.comparing import next_version
from ui.panels.clips.section import use_lines
from ui.shell.dialogs.clip_questions import clip_question_texts
from ui.viewport.excluding.hatched_mask import hatch_lines
from ui.viewport.excluding.mask_tool import MaskTool


def test_versions_are_gone_through_from_the_newest() -> None:
    versions = (VersionStatus(5), VersionStatus(3))
    assert [next_version(versions, shown) for shown in (None, 5, 3, 99)] == [5, 3, None, 5]
    assert next_version((), None) is None


def test_the_room_is_told_part_by_part() -> None:
    use = DiskUse((ClipUse(10, 20, 1, 0), ClipUse(1, 0, 0, 5)), unused=3, other=7)
    assert sum(n for _, n in use_lines(use)) == use.total == 46


def test_questions_say_what_is_lost_and_what_it_costs() -> None:
    cut = clip_question_texts(CutQuestion(SplitClip(5), "Split clip 1 at frame 5", 1, (2, 3), 61.0))
    assert "1:01" in cut[2]
    room = clip_question_texts(RoomQuestion("versions", None, "all earlier versions", 3, 12_000_000))
    assert "12 MB" in room[0]
    damaged = clip_question_texts(DamagedQuestion(2, "Bad.", None, "", "There is nothing before it.", (), None))
    assert any("There is nothing before it." in text for text in damaged)


def test_hatching_lies_on_what_is_painted() -> None:
    lines = hatch_lines([(Stroke(((0.5, 0.5),), 0.1),)], aspect=1.0)
    assert len(lines) > 5
    middles = (lines[:, :2] + lines[:, 2:]) / 2
    assert (np.hypot(*(middles - 0.5).T) <= 0.11).all()
    assert hatch_lines([], aspect=1.5).shape == (0, 4)


def test_the_brush_gives_strokes_of_its_scope() -> None:
    tool = MaskTool()
    tool.start(3, "frame")
    tool.extend(0.5, 0.5)
    tool.extend(0.5, 0.5)
    tool.extend(9.0, -9.0)
    found = tool.take_stroke(7, None, 30)
    assert found == PaintMask(3, 7, 8, Stroke(((0.5, 0.5), (1.5, -0.5)), 0.03))
    assert tool.take_stroke(7, None, 30) is None
    tool.resize(1000)
    assert tool.radius == 0.25


@pytest.mark.slow
def test_the_panel_compares_frees_and_trains_what_is_stale(open_pilot: Callable[..., Pilot]) -> None:
    session = FakeSession()
    session.clip_states = [ClipStatus("trained"), ClipStatus("stale"), ClipStatus("stale")]
    session.queue = QueueStatus(stale=SequenceForecast(2, 10, 120.0))
    session.versions = {0: (VersionStatus(4, "yesterday", n_bytes=10_000_000),)}
    session.disk = DiskUse((ClipUse(10, 20, 1, 0), ClipUse(), ClipUse()))
    pilot = open_pilot(session, size=(1280, 1400))
    pilot.click("training.stale")
    assert session.commands[-1] == TrainStale()
    pilot.click("curves.header")
    pilot.click("clip.header")
    pilot.draw(2)
    pilot.click("clip.compare4")
    assert session.commands[-1] == CompareVersion(0, 4)
    pilot.click("clip.use")
    pilot.draw(2)
    pilot.click("clip.free.versions")
    assert session.commands[-1] == AskFreeSpace("versions")
    pilot.move(*pilot.rects["timeline.clip1"].center)
    pilot.press(4)
    pilot.release(4)
    pilot.draw(2)
    pilot.click("clip menu.merge")
    assert session.commands[-1] == MergeClips(1)


@pytest.mark.slow
def test_a_camera_is_excluded_from_its_menu(open_pilot: Callable[..., Pilot]) -> None:
    session = FakeSession()
    pilot = open_pilot(session)
    pilot.move(*pilot.rects["capture.camera2"].center)
    pilot.press(4)
    pilot.release(4)
    pilot.draw(2)
    pilot.click("exclude menu.camera")
    assert session.commands[-1] == ExcludeCameras((2,))
    session.exclusions = replace_cameras(session, "cam02")
    pilot.draw(3)


def replace_cameras(session: FakeSession, name: str):
    from engine.capture.exclusions import Exclusions

    return Exclusions((name,), session.exclusions.frames, session.exclusions.masks)
