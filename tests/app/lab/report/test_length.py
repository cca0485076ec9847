"""The section on length: one line per clip, whatever is unknown of it, and what is said about early and late clips."""

from __future__ import annotations

import io
import re
from typing import Any

import numpy as np
import pytest
from PIL import Image

from app.background.kernels import COMPILING
from app.lab.figures import PALETTE
from app.lab.report.charts import ChartLine, CurvePanel, draw_over_time, draw_stacked, has_lone_value
from app.lab.report.length import MIN_LATER_CLIPS, length_section
from app.project.project_facts import ClipFacts
from tests.app.lab.report.made_up import Page, change_header, report


def clip(index: int, **entries: Any) -> ClipFacts:
    known: dict[str, Any] = {
        "role": "source" if index else "reference",
        "n_steps": 10,
        "fingerprint": f"clip-{index}",
        "storage": {},
        "stages_s": {COMPILING: 1.0},
        "preparation_s": 5.0,
        "training_s": 10.0 + index,
        "memory_mb": 600.0 + index,
    }
    return ClipFacts(index, 3 * index, 3, **(known | entries))


def evaluation_of(*clips: ClipFacts) -> dict[str, Any]:
    """Two held-out pictures of each clip; clip i has 30 - i dB, and a seam where the one before is trained."""
    indices = [one.clip_index for one in clips]
    means = {"psnr_moving": 20.0, "psnr_rest": 31.0}
    seam = {"score": 0.5, "ratio_static": 1.5, "ratio_moving": 1.1}
    rows = [
        {"clip_index": i, "is_held_out": is_held_out, "psnr": 30.0 - i + more}
        for i in indices
        for is_held_out, more in ((True, -0.5), (True, 0.5), (False, 5.0))
    ]
    return {
        "rows": rows,
        "means": {
            "held_out": {"psnr": 30.0},
            "clips": {str(i): {"held_out": {"psnr": 30.0 - i, **means}, "trained_on": {}} for i in indices},
        },
        "seams": {
            "boundaries": [
                {"clips": [i - 1, i], "frame_index": 3 * i, "held_out": seam, "trained_on": seam}
                for i in indices
                if i - 1 in indices
            ]
        },
    }


def section_of(*clips: ClipFacts) -> tuple[list[str], list[str], list[dict[str, Any]]]:
    """Sentences, names of charts and rows."""
    section = length_section(evaluation_of(*clips), clips)
    (table,) = section.tables()
    said = [part for part in section.parts if isinstance(part, str)]
    return said, [figure.name for figure in section.figures()], table.rows


def test_each_clip_has_its_quality_seam_time_and_memory(quick_charts):
    _, charts, rows = section_of(clip(0), clip(1), clip(2))
    assert charts == ["length_quality", "length_seams", "length_costs"]
    assert [row["frames"] for row in rows] == ["0 to 2", "3 to 5", "6 to 8"]
    assert [row["psnr"] for row in rows] == [30.0, 29.0, 28.0]
    assert [row["psnr_so_far"] for row in rows] == pytest.approx([30.0, 29.5, 29.0])
    assert [row["seam_score"] for row in rows] == [None, 0.5, 0.5]
    assert [row["seam_ratio_static"] for row in rows] == [None, 1.5, 1.5]
    assert [(row["preparation_s"], row["training_s"], row["wall_s"]) for row in rows] == [
        (4.0, 10.0, 14.0),
        (4.0, 11.0, 15.0),
        (4.0, 12.0, 16.0),
    ], "kernels that a machine compiles once are left out"
    assert [row["memory_mb"] for row in rows] == [600.0, 601.0, 602.0]


def test_what_was_not_recorded_is_unknown_and_not_zero(quick_charts):
    unknown = {"preparation_s": None, "training_s": None, "memory_mb": None, "stages_s": {}}
    _, charts, rows = section_of(clip(0, **unknown), clip(1))
    assert [rows[0][name] for name in ("preparation_s", "training_s", "wall_s", "memory_mb")] == [None] * 4
    assert "length_costs" in charts
    _, charts, _ = section_of(clip(0, **unknown), clip(1, **unknown))
    assert charts == ["length_quality", "length_seams"], "nothing to draw of costs"


def test_one_clip_has_a_line_and_no_charts(quick_charts):
    said, charts, rows = section_of(clip(0))
    assert len(said) == 1
    assert charts == []
    assert rows[0]["psnr_so_far"] == pytest.approx(30.0)


def test_clips_that_are_not_trained_are_left_out(quick_charts):
    _, charts, rows = section_of(clip(0), clip(5), clip(6), clip(10))
    assert charts == ["length_quality", "length_seams", "length_costs"]
    assert [row["clip_index"] for row in rows] == [0, 5, 6, 10]
    assert [row["seam_score"] for row in rows] == [None, None, 0.5, None], "only where the clip before is trained"
    assert rows[1]["psnr_so_far"] == pytest.approx(27.5)
    assert section_of(clip(0), clip(5))[1] == ["length_quality", "length_costs"]


def test_early_and_late_clips_are_set_beside_each_other(quick_charts):
    few = [clip(i) for i in range(MIN_LATER_CLIPS)]
    assert "28.50" not in section_of(*few)[0][-1]
    said = section_of(*few, clip(MIN_LATER_CLIPS, memory_mb=None))[0][-1]
    numbers = re.findall(r"\d+(?:\.\d+)?", said)
    for first, last in (("28.50", "24.50"), ("15.5", "19.5"), ("602", "605")):  # memory where it is known
        assert numbers[numbers.index(first) + 1] == last


def test_the_page_shows_the_memory_that_the_clip_files_keep(project):
    metrics = {"preparation_s": 2.0, "training_s": 3.0, "memory_mb": 612.4}
    change_header(project / "clips" / "0001.safetensors", metrics=metrics)
    page = Page(report(project).read_text(encoding="utf-8"))
    first, second = page.tables["length"]
    assert first[-4:] == ["–"] * 4
    assert second[-4:] == ["2.0", "3.0", "5.0", "612"]


# ---------------------------------------------------------------- charts of many values


def picture_of(png: bytes) -> np.ndarray:
    """[H, W] darkness of what stands inside the axes, 0..255."""
    with Image.open(io.BytesIO(png)) as image:
        return 255 - np.asarray(image.convert("L"))


def test_a_value_without_neighbours_is_seen():
    assert has_lone_value(np.array([1.0, np.nan, 2.0, 3.0]))
    assert has_lone_value(np.array([1.0]))
    assert not has_lone_value(np.array([1.0, 2.0, np.nan, 3.0, 4.0]))
    assert not has_lone_value(np.array([np.nan, np.nan]))
    png = draw_over_time([CurvePanel("dB", [ChartLine("a", [20.0, None, 21.0])])], [0, 5, 10], (), "clip")
    with Image.open(io.BytesIO(png)) as image:
        colors = np.asarray(image.convert("RGB")).astype(int)
    far = np.abs(colors - np.array(list(bytes.fromhex(PALETTE[0][1:]))))
    is_line = np.asarray(np.less(far, 30).all(axis=2))
    assert is_line[:, : colors.shape[1] * 3 // 4].sum() > 10, "beside the legend, which stands on the right"


def test_lines_end_where_frames_are_missing():
    """The middle column of the axes is crossed by the line or is not."""
    values = [20.0, 20.5, 21.0, 21.5]

    def crossed(frames: list[int], unit: str) -> bool:
        picture = picture_of(draw_over_time([CurvePanel("", [ChartLine("a", values, is_main=True)])], frames, (), unit))
        middle = picture[20:-60, picture.shape[1] // 2 - 40]
        return bool((middle > 200).sum() > 1)

    assert crossed([0, 1, 101, 102], "clip")
    assert not crossed([0, 1, 101, 102], "frame")


@pytest.mark.slow
@pytest.mark.parametrize("n_clips", [1, 30, 300])
def test_bars_of_many_clips_stay_on_a_page(n_clips):
    with Image.open(
        io.BytesIO(draw_stacked({"a": [1.0] * n_clips}, [f"clip {i}" for i in range(n_clips)], "s"))
    ) as image:
        assert image.height <= 1100
