"""The table of an ablation: means and spread over seeds, frames, as text and as a file."""

from __future__ import annotations

import csv
import io
import math

import pytest

from app.lab.ablation.table import COLUMNS, VariantResult, as_csv, as_text, summarize

RESULTS = [
    VariantResult("full", 0, {"psnr": 20.0, "ssim": 0.9, "lpips": None}),
    VariantResult("other", 0, {"psnr": math.inf, "ssim": 0.5}),
    VariantResult("full", 1, {"psnr": 24.0, "ssim": None}),
]


def test_seeds_become_mean_and_spread():
    full, other = summarize(RESULTS)
    assert [line["variant"] for line in (full, other)] == ["full", "other"]
    assert (full["n_seeds"], other["n_seeds"]) == (2, 1)
    assert full["psnr"] == 22.0
    assert full["psnr_std"] == pytest.approx(math.sqrt(8.0))  # of a sample: (2^2 + 2^2) / (2 - 1)
    assert (full["ssim"], full["ssim_std"]) == (0.9, None)  # of the one seed that has it
    assert other["psnr"] is None  # not finite
    assert full.keys() == {"variant", "n_seeds", "n_frames", *COLUMNS, *(f"{name}_std" for name in COLUMNS)}
    assert summarize([]) == []


def test_the_text_has_a_line_per_variant_and_no_empty_columns():
    lines = as_text(summarize(RESULTS)).splitlines()
    assert lines[0].split() == ["PSNR", "SSIM"]
    assert lines[1].split() == ["full", "22.00", "±2.83", "0.9000"]
    assert lines[2].split() == ["other", "-", "0.5000"]
    assert len({len(line) for line in lines}) == 1
    assert as_text([]).strip() == ""


def test_a_line_says_on_how_many_frames_it_was_measured():
    lines = summarize([VariantResult("full", 0, {"psnr": 20.0}, 6), VariantResult("first-frame", 0, {"psnr": 30.0}, 1)])
    assert [line["n_frames"] for line in lines] == [6, 1]
    text = [line.split() for line in as_text(lines).splitlines()]
    assert text == [["frames", "PSNR"], ["full", "6", "20.00"], ["first-frame", "1", "30.00"]]
    assert [row["n_frames"] for row in csv.DictReader(io.StringIO(as_csv(lines)))] == ["6", "1"]


def test_the_file_has_full_precision():
    rows = list(csv.DictReader(io.StringIO(as_csv(summarize(RESULTS)))))
    assert [row["variant"] for row in rows] == ["full", "other"]
    assert float(rows[0]["psnr_std"]) == math.sqrt(8.0)
    assert rows[1]["psnr"] == ""


def test_every_figure_that_a_row_is_judged_by_has_a_column_with_a_mean_and_a_spread():
    judged = {
        *("psnr", "psnr_moving", "psnr_rest", "ssim", "dssim1", "dssim_range2", "dssim_ms", "tof", "flicker_inside"),
        *("flicker_borders", "seam_ratio_static", "megabytes", "minutes", "fps_cpu", "fps_gl"),
    }
    assert judged <= COLUMNS.keys()
    results = [VariantResult("full", seed, dict.fromkeys(judged, 1.0 + seed)) for seed in (0, 1)]
    (line,) = summarize(results)
    assert {line[name] for name in judged} == {1.5}
    assert [line[f"{name}_std"] for name in judged] == pytest.approx([math.sqrt(0.5)] * len(judged))
