"""The page at the end of an ablation."""

from __future__ import annotations

import json
from functools import partial

import pytest

from app.lab.ablation import report
from app.lab.report.write import write_report
from tests.app.lab.report.made_up import FakePictures, Measure, Page, draw_nothing


@pytest.fixture
def arguments(runner, capture_folder, monkeypatch):
    draw_nothing(monkeypatch)
    quick = partial(write_report, measuring=Measure(), make_pictures=FakePictures)
    monkeypatch.setattr(report, "write_report", quick)
    return ["ablate", capture_folder, "--project", runner.folder, "--clip-length", 3, "--quiet"]


def test_the_page_shows_the_first_seed_and_the_table_of_all(run, runner, arguments):
    code, _, err = run(*arguments, "--variants", "decoder-new", "--seeds", "1,0", "--report")
    assert code == 0, err
    path = runner.folder / "report" / "report.html"
    page = Page(path.read_text(encoding="utf-8"))
    assert page.attributes("section")[0]["id"] == "ablation"
    assert [row[0] for row in page.tables["ablation"]] == ["full", "decoder-new"]
    assert [row[2] for row in page.tables["ablation"]] == ["2", "2"]
    assert "All pictures below are of the projects of seed 1." in page.text
    assert [row[0] for row in page.tables["comparison"]] == ["full-seed1", "decoder-new-seed1"]
    assert [row[0] for row in page.tables["change_maps"]][1:] == ["full-seed1", "decoder-new-seed1"]
    numbers = json.loads((runner.folder / "report" / "report.json").read_text())
    rows = numbers["tables"]["ablation"]["rows"]
    assert rows[0]["psnr"] == 22.0
    assert rows[0]["psnr_std"] == 0.0
    assert (runner.folder / "report" / "tables" / "ablation.csv").is_file()


def test_variants_of_an_earlier_call_are_on_the_page_and_nothing_is_trained_again(run, runner, arguments):
    run(*arguments, "--variants", "decoder-new")
    run(*arguments, "--variants", "residual-none")
    n_launched = len(runner.launched)
    code, _, err = run(*arguments[:-1], "--variants", "full", "--report")
    assert code == 0, err
    assert len(runner.launched) == n_launched
    assert f"Report: {runner.folder / 'report' / 'report.html'}" in err
    page = Page((runner.folder / "report" / "report.html").read_text(encoding="utf-8"))
    assert [row[0] for row in page.tables["comparison"]] == ["full-seed0", "decoder-new-seed0", "residual-none-seed0"]


def test_a_file_in_the_place_of_the_page_is_found_before_the_training(run, runner, arguments):
    runner.folder.mkdir()
    (runner.folder / "report").touch()
    code, _, err = run(*arguments, "--report")
    assert code == 2
    assert "is a file" in err
    assert runner.launched == []
