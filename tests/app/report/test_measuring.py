"""What the page says when something is missing; what is measured once is not measured again."""

from __future__ import annotations

import json
import shutil
from functools import partial

from app.report.cache import evaluation_of
from app.report.facts import read_facts
from app.report.labels import FIGURE_LABELS
from engine.metrics.columns import COLUMNS
from tests.app.report.made_up import CAMERAS, Measure, Page, change_header, report, train


def test_one_clip_has_no_seam(tmp_path, capture_folder, quick_charts):
    project = train(tmp_path / "p", capture_folder, n_clips=1)
    text = Page(report(project).read_text(encoding="utf-8")).text
    assert "so there is no boundary to measure" in text
    assert "in no figure of this page: clip 1" in text
    assert not list((project / "reports" / "figures").glob("seam_0*"))


def test_without_held_out_cameras_the_page_says_so(tmp_path, capture_folder, quick_charts):
    project = train(tmp_path / "p", capture_folder, holdout=())
    page = Page(report(project).read_text(encoding="utf-8"))
    assert "No camera was held out" in page.text
    assert page.tables["worst_psnr"][0][0] in CAMERAS
    assert len(page.tables["clip_metrics"][0]) == 3 + 3 + 1  # all and two clips, of one group


def test_a_training_without_recorded_times_is_not_drawn(project):
    for path in (project / "clips").iterdir():
        change_header(path, lambda header: header.update(metrics={}))
    page = Page(report(project).read_text(encoding="utf-8"))
    assert "Not recorded when it was trained: clip 0, 1" in page.text
    assert "no wall time was recorded when it was trained: p" in page.text
    assert not (project / "reports" / "figures" / "speed_error.png").exists()
    assert page.tables["times"][0][2:] == ["–"] * 5


def test_quick_figures_are_no_rows_of_nothing(project):
    page = Page(report(project, metrics="quick").read_text(encoding="utf-8"))
    rows = {row[0]: row for row in page.tables["clip_metrics"]}
    quick = [name for name, column in COLUMNS.items() if column.is_quick]
    assert list(rows) == [FIGURE_LABELS[name] for name in quick]
    assert f"{len(COLUMNS) - len(quick)} figures that take longer were not asked for; --metrics all" in page.text
    assert not any("not measured" in cell or "quick choice" in cell for row in rows.values() for cell in row)
    assert "worst_flip" not in page.tables


def test_a_shorter_report_leaves_no_files_of_the_longer_one(project):
    report(project)
    figures, foreign = project / "reports" / "figures", project / "reports" / "figures" / "mine.png"
    assert (figures / "seam_000003.png").is_file()
    foreign.touch()
    (project / "clips" / "0001.safetensors").unlink()
    report(project)
    assert not (figures / "seam_000003.png").exists()
    assert foreign.exists()


def test_two_clips_are_shown_where_the_clip_before_says_more_than_its_last_frame(project):
    def measured(*, held: set[str]) -> Page:
        def with_two_clips(opened, **options):
            document = Measure()(opened, **options)
            for row in document["seams"]["rows"]:
                if row["is_boundary"]:
                    row |= {"is_held": row["camera"] in held, "two_clips_static": 0.02, "two_clips_moving": None}
                    row |= {"change_static": 0.01 * (1 + (row["camera"] == "0"))}
            return document

        shutil.rmtree(project / "reports", ignore_errors=True)
        return Page(report(project, with_two_clips).read_text(encoding="utf-8"))

    said = "At 1 of the borders the field of the clip before ends with its last frame"
    page = measured(held=set(CAMERAS))
    assert said in page.text
    assert "two_clips" not in page.tables
    page = measured(held=set())
    assert said not in page.text
    assert page.tables["two_clips"] == [["3", "4", "5.100", "–", "3.188", page.tables["two_clips"][0][-1]]]


def test_a_second_report_measures_nothing(project):
    measure = Measure()
    report(project, measure)
    report(project, measure, metrics="quick")  # all columns are at least as good
    assert measure.asked == [("p", "all")]
    change_header(project / "clips" / "0001.safetensors", lambda header: header.update(fingerprint="another"))
    report(project, measure)
    assert measure.asked == [("p", "all")] * 2
    (project / "reports" / "eval-all.json").write_text("{")
    report(project, measure)
    assert measure.asked == [("p", "all")] * 3


def test_rounded_pictures_are_measured_and_kept_by_themselves(project):
    measure = Measure()
    report(project, measure)
    report(project, measure, precision="8bit")
    page = Page(report(project, measure, precision="8bit").read_text(encoding="utf-8"))
    assert ["Figures", "all columns, pictures compared as 8bit"] in page.tables["setup"]
    assert measure.asked == [("p", "all")] * 2
    assert json.loads((project / "reports" / "eval-all-8bit.json").read_text())["evaluation"]["precision"] == "8bit"
    report(project, measure)
    assert len(measure.asked) == 2


def test_compared_projects_are_measured_quickly_unless_all_is_there(project, tmp_path, capture_folder):
    train(tmp_path / "more" / "a", capture_folder)
    train(tmp_path / "more" / "b", capture_folder)
    measure = Measure()
    report(tmp_path / "more" / "a", measure)
    page = Page(report(project, measure, compare=[tmp_path / "more"]).read_text(encoding="utf-8"))
    assert measure.asked == [("a", "all"), ("p", "all"), ("b", "quick")]
    assert [row[-1] for row in page.tables["comparison"]] == ["all", "all", "quick"]
    report(project, measure, compare=[tmp_path / "more"], metrics="all")
    assert measure.asked[3:] == [("b", "all")]


def test_where_a_project_cannot_be_written_to_its_figures_are_kept_beside_the_page(project, tmp_path):
    (project / "reports").touch()  # a file where the folder would be
    measure = Measure()
    for _ in range(2):
        report(project, measure, out=tmp_path / "out")
    assert measure.asked == [("p", "all")]
    assert len(list((tmp_path / "out" / "evaluations").iterdir())) == 1


def test_an_evaluation_is_of_these_clips_and_this_choice(project):
    measure = Measure()
    facts = read_facts(project, "p")
    ask = partial(evaluation_of, fallback_dir=project, on_progress=lambda *_: None, measure=measure)
    assert ask(facts, choices=["quick"]) == ask(facts, choices=["all", "quick"])
    ask(facts, choices=["all"])
    assert [choice for _, choice in measure.asked] == ["quick", "all"]
