"""Figures over frames per clip, and over frames from the first."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.lab.ablation.variants import settings_of
from app.lab.report.paper_figures import over_length
from app.lab.report.paper_figures.over_length import clip_length_section, sequence_length_section
from app.project.opening.project_access import default_settings
from engine.capture.capture import open_capture
from engine.capture.clip import split_clips
from tests.app.lab.ablation.runs import BY_NAME
from tests.app.lab.report.paper_figures.made_up import clip, compared


@pytest.fixture
def drawn(monkeypatch):
    """Panels of the charts, which are not drawn."""
    kept = []
    monkeypatch.setattr(over_length, "draw_over_length", lambda panels, *_args, **_options: kept.append(panels) or b"")
    return kept


@pytest.fixture
def settings(capture_folder):
    return default_settings(open_capture(capture_folder), clip_length=3, holdout=("0",))


def rows_of(section, project):
    (table,) = [table for table in section.tables() if table.name == section.anchor]
    return [row for row in table.rows if row["project"] == project]


def test_means_are_of_the_first_clips(settings, drawn):
    psnr = {("a", frame): 20.0 + frame for frame in range(6)} | {("b", frame): 20.0 + frame for frame in range(6)}
    clips = [clip(0, 0, 3, seconds=60.0), clip(1, 3, 3, seconds=30.0)]
    one = compared("p", clips, psnr=psnr | {("c", 0): 99.0}, excess={("a", 3): 0.05}, settings=settings)
    unknown = compared("q", [clip(0, 0, 3), clip(1, 3, 3, seconds=None)], settings=settings)
    section = sequence_length_section([one, unknown])
    assert section is not None
    first, last = rows_of(section, "p")
    assert [first[key] for key in ("n_clips", "n_frames", "psnr")] == [1, 3, 21.0]
    assert [last[key] for key in ("n_clips", "n_frames", "psnr")] == [2, 6, 22.5]
    assert [first["minutes"], last["minutes"]] == [1.0, 1.5]
    assert [first["megabytes"], last["megabytes"]] == [1.0, 2.0]
    assert last["mb_per_frame"] == pytest.approx(2 / 6)
    assert [first["score"], first["flicker_borders"]] == [None, None]
    assert last["score"] == pytest.approx(one.evaluation["seams"]["means"]["held_out"]["score"])
    assert last["flicker_borders"] == pytest.approx(255 * 0.02)
    assert [row["minutes"] for row in rows_of(section, "q")] == [pytest.approx(0.1), None]
    (panels,) = drawn
    assert {tuple(series.label for series in panel.series) for panel in panels} == {("p", "q")}


def test_one_clip_is_shown_up_to_where_the_clips_of_the_first_end(settings, drawn):
    joint = compared("joint", [clip(0, 0, 6)], psnr={("a", 0): 26.0}, settings=settings)
    section = sequence_length_section([compared("p", [clip(0, 0, 3), clip(1, 3, 3)], settings=settings), joint])
    assert section is not None
    before, end = rows_of(section, "joint")
    assert [before["n_frames"], before["psnr"], before["megabytes"], before["minutes"]] == [3, 21.0, None, None]
    assert [end["n_frames"], end["psnr"], end["megabytes"]] == [6, 20.5, 1.0]
    assert sequence_length_section([joint]) is None


def test_of_very_many_clips_some_are_left_out(settings, drawn):
    many = compared("p", [clip(i, i, 1) for i in range(95)], cameras="a", settings=settings)
    section = sequence_length_section([many])
    assert section is not None
    numbers = [row["n_frames"] for row in rows_of(section, "p")]
    assert len(numbers) == over_length.MAX_ENDS
    assert numbers[-1] == 95
    assert numbers == sorted(set(numbers))


def test_only_projects_that_differ_by_clip_length_alone_are_joined(settings, drawn):
    two, one = [clip(0, 0, 3), clip(1, 3, 3)], [clip(0, 0, 6)]
    longer = replace(settings, clip_length=6, overrides={"joint_steps": 9})
    other = replace(settings, clip_length=6, overrides={"decoder": "new"})
    projects = [
        compared("p", two, settings=settings),
        compared("longer", one, settings=longer),
        compared("other", one, settings=other),
        compared("elsewhere", one, settings=replace(longer, fingerprint="x")),
        compared("fewer", two[:1], settings=replace(settings, clip_length=2)),
    ]
    section = clip_length_section(projects)
    assert section is not None
    (panels,) = drawn
    assert [series.label for series in panels[0].series] == ["p", "other"]
    assert [x for x, _ in panels[0].series[0].points] == [3, 6]
    assert [row["project"] for row in next(section.tables()).rows] == ["p", "longer", "other"]
    assert clip_length_section(projects[:1]) is None


def test_clips_that_inherit_and_clips_on_their_own_have_a_curve_each(settings, drawn):
    """Over three lengths of clips, with settings as an ablation makes them."""
    clips = {length: [clip(i, start, length) for i, start in enumerate(range(0, 12, length))] for length in (3, 6, 12)}
    projects = []
    for name, cuts in (("clips", ("shorter", "", "longer")), ("independent", ("shorter", "", "longer"))):
        for length, cut in zip(clips, cuts, strict=True):
            variant = BY_NAME[f"{name}-{cut}" if cut else {"clips": "full"}.get(name, name)]
            overrides, own_length, _ = settings_of(
                variant, {}, clips=split_clips(12, 6), n_cameras=40, n_capture_frames=12
            )
            assert own_length == length
            changed = replace(settings, clip_length=length, overrides=overrides)
            projects.append(compared(variant.name, clips[length], settings=changed))
    assert clip_length_section(projects) is not None
    (panels,) = drawn
    assert [[x for x, _ in series.points] for series in panels[0].series] == [[3, 6, 12]] * 2
    assert [series.label for series in panels[0].series] == ["clips-shorter", "independent-shorter"]
