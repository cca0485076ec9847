"""Pieces of a report by themselves: Pareto front, markup, tables, names, worst frames, charts."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from app.lab.report.charts import draw_pictures
from app.lab.report.measured import clip_borders, worst_pictures
from app.lab.report.page.markup import escaped, tag
from app.lab.report.page.tables import Table, TableColumn
from app.lab.report.pareto import pareto_front
from app.project.clips.clip_bytes import storage_of
from app.project.project_facts import short_names
from engine.errors import ProjectError
from tests.app.lab.report.made_up import report


def test_the_front_is_what_nobody_beats(rng):
    points = [(1.0, 5.0), (2.0, 4.0), (2.0, 6.0), (3.0, 6.0), (4.0, 9.0), (4.0, 9.0)]
    assert pareto_front(points, is_higher_better=True) == [0, 2, 4, 5]
    assert pareto_front(points, is_higher_better=False) == [0, 1]
    assert pareto_front([], is_higher_better=True) == []
    for is_higher_better in (True, False):
        for _ in range(50):
            drawn = [(float(x), float(y)) for x, y in rng.integers(0, 6, (12, 2))]
            sign = 1 if is_higher_better else -1

            def is_beaten(p, drawn=drawn, sign=sign):
                return any(x <= p[0] and sign * y >= sign * p[1] and (x, y) != p for x, y in drawn)

            expected = {i for i, p in enumerate(drawn) if not is_beaten(p)}
            assert set(pareto_front(drawn, is_higher_better=is_higher_better)) == expected


def test_text_becomes_markup_only_on_purpose():
    inner = tag("b", "<x>")
    assert tag("p", inner, ' & "y"', class_='a"b', hidden=True, title=None) == (
        '<p class="a&quot;b" hidden><b>&lt;x&gt;</b> &amp; &quot;y&quot;</p>'
    )
    assert escaped("\udcff") == "?"


def test_a_table_refuses_rows_of_another_shape():
    with pytest.raises(ValueError, match="too many or too few"):
        Table("t", "c", [TableColumn("a", "A")], [{"a": 1, "b": 2}])


def test_only_values_with_a_direction_are_the_best():
    columns = [TableColumn("a", "A", 1, True), TableColumn("b", "B", 1, False), TableColumn("c", "C", 1)]
    rows = [{"a": 1.0, "b": 1.0, "c": 1.0}, {"a": 2.0, "b": 2.0, "c": 2.0}, {"a": None, "b": None, "c": None}]
    text = Table("t", "c", columns, rows).markup()
    assert text.count("<b>") == 2
    assert "<b>2.0</b>" in text.split("<tr>")[3]
    assert "<b>1.0</b>" in text.split("<tr>")[2]


def test_names_tell_folders_apart(tmp_path):
    folders = [tmp_path / "a" / "p", tmp_path / "b" / "p", tmp_path / "q"]
    assert short_names(folders) == ["a/p", "b/p", "q"]


def test_worst_pictures_are_of_different_clips_and_cameras():
    rows = [
        {"camera": camera, "clip_index": clip, "frame_index": 3 * clip + i, "is_held_out": camera != "2"}
        | {"psnr": 20.0 + i + clip, "psnr_moving": None if clip == 0 else 20.0 - i}
        for camera in ("0", "1", "2")
        for clip in (0, 1)
        for i in range(3)
    ]
    chosen = worst_pictures({"rows": rows, "means": {"held_out": {"psnr": 20.0}}})
    assert [(name, row["camera"], row["frame_index"]) for name, row in chosen] == [
        ("psnr", "0", 0),
        ("psnr", "1", 0),
        ("psnr", "0", 3),
        ("psnr", "1", 3),
        ("psnr_moving", "0", 5),
        ("psnr_moving", "1", 5),
    ]


def test_borders_are_the_first_frames_of_clips():
    assert clip_borders({"frame_index": [0, 1, 5, 6, 9], "clip_index": [0, 0, 1, 1, 2]}) == [5, 9]


@pytest.mark.slow
def test_the_range_of_error_pictures_is_locked():
    import matplotlib as mpl

    truth = np.zeros((24, 32, 3), np.uint8)

    def counts(error: float) -> list[int]:
        with Image.open(io.BytesIO(draw_pictures(truth, np.full((24, 32, 3), error), (0.0, 0.25)))) as picture:
            pixels = np.asarray(picture.convert("RGB")).reshape(-1, 3)
        colors = [np.round(np.array(mpl.colormaps["cividis"](x)[:3]) * 255) for x in (0.0, 1.0)]
        return [int((np.abs(pixels - color) <= 1).all(1).sum()) for color in colors]

    low, high = counts(0.0), counts(0.25)
    assert low[0] > 10_000 > low[1]
    assert high[1] > 10_000 > high[0]


def test_a_damaged_clip_is_said(project):
    path = project / "clips" / "0001.safetensors"
    path.write_bytes(path.read_bytes()[:40])
    with pytest.raises(ProjectError, match="damaged"):
        storage_of(path)
    with pytest.raises(ProjectError, match="damaged"):
        report(project)
