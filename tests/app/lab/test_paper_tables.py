"""The paper's tables: complete, as printed, and next to the right variants and captures."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.lab.ablation.table import COLUMNS, paper_text
from app.lab.ablation.variants import VARIANTS
from app.lab.paper_tables import ANOTHER_CAPTURE, FIGURES, OWN_FIGURES, PAPER_TABLES, beside_ablations, tables_like

FULL_HD, N3DV = (1920, 1080), (2704, 2028)


def value(number: int, method: str, column: str) -> float | None:
    table = PAPER_TABLES[number - 1]
    (row,) = (row for row in table.rows if row.method == method)
    return table.figures(row)[column]


def test_all_six_tables_are_there_with_values_for_their_columns():
    assert [table.number for table in PAPER_TABLES] == [1, 2, 3, 4, 5, 6]
    assert [len(table.rows) for table in PAPER_TABLES] == [9, 7, 14, 7, 3, 3]
    for table in PAPER_TABLES:
        assert set(table.columns) <= FIGURES.keys()
        assert all(table.figures(row)["psnr"] for row in table.rows)
        assert len({row.method for row in table.rows}) == len(table.rows)
        best = max(table.rows, key=lambda row: row.values[0] or 0.0)  # static methods are of one frame
        assert best.method == "ClipGStream" or (table.number, best.method) == (2, "2DGS")


@pytest.mark.parametrize(
    ("number", "method", "column", "expected"),
    [
        (1, "ClipGStream", "psnr", 24.54),
        (1, "LocalDyGS", "lpips", 0.178),
        (2, "ClipGStream", "ssim", 0.946),
        (3, "ClipGStream", "fps", 106),
        (3, "4DGaussian", "megabytes", 90),
        (3, "K-Planes", "dssim1", None),
        (4, "4DGaussian", "ssim", 0.952),
        (5, "w/o RAC", "dssim2", 0.044),
        (6, "Independent Training", "lpips", 0.316),
    ],
)
def test_values_are_those_that_are_printed(number, method, column, expected):
    assert value(number, method, column) == expected


def test_the_row_of_a_shared_field_is_that_of_another_method_to_the_digit():
    for column in PAPER_TABLES[5].columns:
        assert value(6, "Shared STF", column) == value(1, "LocalDyGS", column)


def test_bounds_are_printed_as_such():
    table = PAPER_TABLES[2]
    texts = {row.method: table.texts(row) for row in table.rows}
    assert texts["RealTimeGS"] == ["32.01", "", "0.014", "114", "9", "> 1000"]
    assert texts["SpaceTimeGS"][4] == "> 5"
    assert texts["NeRFPlayer"] == ["30.69", "0.034", "", "0.05", "6", "5130"]


def test_variants_stand_next_to_their_rows():
    names = {variant.name for variant in VARIANTS}
    found = beside_ablations({"variant": name, "psnr": 20.0, "dssim_ms": 0.1} for name in sorted(names))
    assert {(row["variant"], row["paper_row"], row["tables"]) for row in found} == {
        ("full", "ClipGStream", "5, 6"),
        ("decoder-new", "w/o DI", "5"),
        ("residual-none", "w/o RAC", "5"),
        ("residual-full", "w/o RAC", "5"),
        ("independent", "Independent Training", "6"),
        ("field-continue", "Shared STF", "6"),
    }
    (row,) = (row for row in found if row["variant"] == "decoder-new")
    assert (row["psnr"], row["paper_psnr"]) == (20.0, 24.34)
    assert (row["dssim_range2"], row["dssim_ms"], row["paper_dssim2"]) == (None, 0.1, 0.038)
    assert {name for names in OWN_FIGURES.values() for name in names} <= COLUMNS.keys()


def test_nothing_stands_next_to_full_alone():
    assert beside_ablations([{"variant": "full"}, {"variant": "clips-longer"}]) == []
    assert paper_text([]) == ""


def test_the_text_marks_another_capture_and_leaves_out_what_was_not_measured():
    rows = beside_ablations([{"variant": "full", "psnr": 28.0}, {"variant": "independent", "psnr": 27.5}])
    head, *lines, said = paper_text(rows).split("\n")
    assert head.split() == ["row", "of", "the", "paper", "PSNR", "paper"]
    assert [line.split() for line in lines] == [
        ["full", "ClipGStream", "28.00", "24.54"],
        ["independent", "Independent", "Training", "27.50", "21.85"],
    ]
    assert said == ANOTHER_CAPTURE
    assert "Long 360, 1,400 frames, another capture" in said


@pytest.mark.parametrize(
    ("layout", "n_cameras", "sizes", "folder", "numbers"),
    [
        ("colmap frames", 36, [(3840, 2160)], "basketball", [1]),
        ("colmap frames", 34, [FULL_HD], "GZ", [2]),
        ("colmap frames", 34, [(1280, 720)], "GZ", []),
        ("colmap frames", 13, [(1280, 720)], "discussion", []),
        ("n3dv", 19, [N3DV], "cook_spinach", [3]),
        ("n3dv", 18, [(1352, 1014)], "Flame_Salmon_1", [3, 4]),
        ("n3dv", 13, [(1280, 720)], "discussion", []),
        ("sample", 36, [FULL_HD], "salmon", []),
    ],
)
def test_a_capture_is_known_by_its_layout_cameras_sizes_and_name(layout, n_cameras, sizes, folder, numbers):
    found = tables_like(layout, n_cameras, sizes, Path("data") / folder)
    assert [table.number for table in found] == numbers
