"""Places chosen by hand, on the page and on the command line."""

from __future__ import annotations

import json

import pytest

from app.cli.cli import main
from app.lab.report.paper_figures.by_hand import FigureOptions, InsetWindow, checked_places
from app.project.project_facts import read_facts
from engine.capture.capture import open_capture
from tests.app.fakes import write_capture
from tests.app.lab.report.made_up import Measure, Page, report, train


@pytest.fixture
def other(tmp_path, capture_folder):
    return train(tmp_path / "q", capture_folder, source_steps=7)


def test_chosen_places_are_shown(project, other):
    wishes = FigureOptions(3, "2", ["1:4:3,2,8,6", "0:0:0,0,32,24"])
    path = report(project, compare=[other], wishes=wishes)
    page = Page(path.read_text(encoding="utf-8"))
    assert [row[:2] for row in page.tables["change_maps"]] == [["capture (G)", ""], ["p", "0 to 1"], ["q", "0 to 1"]]
    assert "Frame 2 to frame 3, camera 2: chosen by hand." in page.text
    assert [row[:5] for row in page.tables["crops"]] == [
        ["1", "1", "4", "3, 2, 8, 6", "p"],
        ["1", "1", "4", "3, 2, 8, 6", "q"],
        ["2", "0", "0", "0, 0, 32, 24", "p"],
        ["2", "0", "0", "0, 0, 32, 24", "q"],
    ]
    assert "chosen by hand: --crop 1:4:3,2,8,6." in page.text
    names = {path.name for path in (project / "reports" / "figures").iterdir()}
    assert {"change_maps.png", "crop_01.png", "crop_02.png", "features_apart.png"} <= names
    assert (project / "reports" / "tables" / "crops.csv").is_file()


def test_without_wishes_rules_choose_and_say_so(project, other):
    page = Page(report(project, compare=[other]).read_text(encoding="utf-8"))
    assert "where E on static pixels, the mean over all projects, is largest" in page.text
    assert "Pictures are those in which the PSNR of the projects differs most" in page.text
    assert {row[1] for row in page.tables["crops"]} == {"0"}  # the camera that is held out
    assert [row[0] for row in page.tables["features_apart"]] == ["0", "1"]


def test_a_project_alone_shows_maps_and_windows_only_by_hand(project):
    page = Page(report(project).read_text(encoding="utf-8"))
    assert "features_apart" in page.tables
    assert not {"change_maps", "crops", "over_sequence_length"} & page.tables.keys()
    page = Page(report(project, wishes=FigureOptions(camera="0", crops=["0:1:0,0,4,4"])).read_text(encoding="utf-8"))
    assert [row[0] for row in page.tables["change_maps"]] == ["capture (G)", "p"]
    assert [row[4] for row in page.tables["crops"]] == ["p"]


def test_equal_reports_have_equal_figures_and_numbers(project, other, tmp_path):
    texts = []
    for name in ("one", "two"):
        report(project, compare=[other], out=tmp_path / name)
        tables = json.loads((tmp_path / name / "report.json").read_text())["tables"]
        texts.append([tables[key] for key in ("change_maps", "crops", "features_apart", "over_sequence_length")])
    assert texts[0] == texts[1]


def test_a_project_of_another_capture_is_in_no_picture(project, tmp_path, capture_folder):
    train(tmp_path / "more" / "elsewhere", write_capture(tmp_path / "other_capture", n_frames=9))
    train(tmp_path / "more" / "fewer", capture_folder, n_clips=1)
    page = Page(report(project, compare=[tmp_path / "more"]).read_text(encoding="utf-8"))
    assert "elsewhere is in none of the pictures, because it is of another capture." in page.text
    assert "Not trained on frames 2 and 3, so not here: fewer." in page.text
    assert [row[0] for row in page.tables["change_maps"]] == ["capture (G)", "p"]


def test_only_held_out_cameras_of_the_others_are_measured(project, other):
    measure = Measure()
    report(project, measure, compare=[other])
    assert measure.n_rows == 6 * 4 + 6 * 1


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--camera", "9"], "There is no camera '9'"),
        (["--camera", "0,1"], "--camera is '0,1'; name one camera."),
        (["--camera", "none"], "--camera is 'none'; name one camera."),
        (["--boundary", "2"], "--boundary is 2, where no two trained clips meet. Clips meet at frame 3."),
        (["--boundary", "x"], "invalid int value"),
        (["--crop", "0:0"], "--crop is '0:0', which is not a window. Write CAMERA:FRAME:X,Y,WIDTH,HEIGHT"),
        (["--crop", "0:0:-1,0,4,4"], "which is not a window"),
        (["--crop", "8:0:0,0,4,4"], "There is no camera '8'"),
        (["--crop", "0:6:0,0,4,4"], "frame 6 is in no trained clip. Trained are frames 0 to 2, 3 to 5."),
        (["--crop", "0:0:29,0,4,4"], "reaches outside of the picture. Pictures of camera 0 are 32 x 24 pixels."),
        (["--crop", "0:0:0,0,0,4"], "which is empty or reaches outside"),
        (["--crop", f"0:{'9' * 5000}:0,0,4,4"], "which is not a window"),
    ],
)
def test_places_that_do_not_exist_end_with_2_before_anything_is_measured(project, capsys, arguments, expected):
    try:
        code = main(["report", str(project), *arguments, "--quiet"])
    except SystemExit as ended:
        code = ended.code
    said = capsys.readouterr().err
    assert code == 2
    assert expected in said
    assert "bug in the program" not in said
    assert not (project / "reports").exists()
    assert not (project / "evaluations").exists()


def test_cameras_may_be_numbers_and_names_may_have_colons(project, tmp_path, capture_folder):
    capture, facts = open_capture(capture_folder), read_facts(project, "p")
    places = checked_places(FigureOptions(3, "1", ["2:5:0,0,32,24"]), capture, [facts])
    assert places.camera == "1"
    assert places.windows == [InsetWindow("2", 5, 0, 0, 32, 24)]
    assert places.windows[0].as_argument == "2:5:0,0,32,24"
    assert checked_places(FigureOptions(), capture, [facts]).windows == []
