"""What the page says when something is missing; what is measured once is not measured again."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace

import pytest

from app.evaluation.evaluation import EvaluationScope, is_measured
from app.evaluation.headless import open_trained
from app.lab.report.measured import N_PICTURES
from app.lab.report.page.labels import FIGURE_LABELS
from app.lab.report.seam_parts import N_BOUNDARIES
from app.project.opening.project_access import open_project
from engine.clip_files.clip_state import read_clip_header
from engine.metrics.clips.seams import PairRow
from engine.metrics.columns import COLUMNS
from engine.storage.json_files import checked_line
from tests.app.fakes import write_capture
from tests.app.lab.report.made_up import CAMERAS, Measure, Page, change_header, report, train


def test_one_clip_has_no_seam(tmp_path, capture_folder, quick_charts):
    project = train(tmp_path / "p", capture_folder, n_clips=1)
    text = Page(report(project).read_text(encoding="utf-8")).text
    assert "so there is no boundary to measure" in text
    assert "in no figure of this page: clip 1" in text
    assert not list((project / "reports" / "figures").glob("seam_0*"))


@pytest.mark.slow
def test_many_clips_do_not_make_a_page_of_lists(tmp_path, quick_charts):
    """24 clips of three frames, of which one in the middle is not trained."""
    project = train(tmp_path / "p", write_capture(tmp_path / "capture", n_frames=72), n_clips=24)
    (project / "clips" / "0005.safetensors").unlink()
    for path in (project / "clips").iterdir():
        change_header(path, metrics={"stages_s": {"Carving": 1.0}, "preparation_s": 1.0, "training_s": 0.0})
    page = Page(report(project, metrics="quick").read_text(encoding="utf-8"))
    assert "23 of 24 trained: 0 to 4, 6 to 23 (frames 0 to 14, 18 to 71)" in page.text
    assert "in no figure of this page: clip 5." in page.text
    assert "22 clips begin, one after each dashed line" in page.text
    assert len(page.tables["clip_metrics"][0]) == 3 + 2 + 1, "all clips together; two groups of cameras"
    numbers = json.loads((project / "reports" / "report.json").read_text(encoding="utf-8"))
    assert len(numbers["tables"]["clip_metrics"]["columns"]) == 3 + 2 * 24 + 1
    assert "stages" in numbers["tables"]
    assert "stages" not in page.tables
    assert [row[0] for row in page.tables["length"]] == [str(i) for i in range(24) if i != 5]
    assert page.tables["length"][5][6] == "–", "there is no seam to a clip that is not trained"
    assert len(list((project / "reports" / "figures").glob("seam_0*"))) == N_BOUNDARIES
    assert len(list((project / "reports" / "figures").glob("worst_*"))) <= N_PICTURES


def test_without_held_out_cameras_the_page_says_so(tmp_path, capture_folder, quick_charts):
    project = train(tmp_path / "p", capture_folder, holdout=())
    page = Page(report(project).read_text(encoding="utf-8"))
    assert "No camera was held out" in page.text
    assert page.tables["worst_psnr"][0][0] in CAMERAS
    assert len(page.tables["clip_metrics"][0]) == 3 + 3 + 1  # all and two clips, of one group


def test_a_training_without_recorded_times_is_not_drawn(project):
    for path in (project / "clips").iterdir():
        change_header(path, metrics={})
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
    class WithTwoClips(Measure):
        def __init__(self, held: set[str]) -> None:
            super().__init__()
            self.held = held

        def pair(self, row: PairRow) -> PairRow:
            if not row.is_boundary:
                return row
            change = 0.01 * (1 + (row.camera == "0"))
            return replace(row, is_held=row.camera in self.held, two_clips_static=0.02, change_static=change)

    def measured(*, held: set[str]) -> Page:
        shutil.rmtree(project / "evaluations", ignore_errors=True)
        return Page(report(project, WithTwoClips(held)).read_text(encoding="utf-8"))

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
    assert measure.asked == [("p", "all", 0), ("p", "all", 1)]


def test_a_clip_that_changed_is_measured_again_and_no_other(project):
    measure = Measure()
    report(project, measure)
    change_header(project / "clips" / "0001.safetensors", fingerprint="another")
    report(project, measure)
    assert measure.asked[2:] == [("p", "all", 1)]
    assert measure.n_rows == 24 + 12


def test_of_a_clip_behind_one_that_changed_only_the_boundary_is_measured_again(project):
    measure = Measure()
    report(project, measure)
    before = (project / "evaluations" / "0001-all-float.jsonl").read_bytes()
    other = EvaluationScope([0, 1], range(4), "all", "float")
    opened = open_trained(open_project(project, is_writable=False))
    assert is_measured(opened, other)
    rows = [json.loads(line) for line in before.splitlines()]
    assert sum("row" in row for row in rows) == 12
    assert sum("pair" in row for row in rows) == 12
    assert {row["before"] for row in rows if row.get("pair", {}).get("is_boundary")} == {rows_fingerprint(project)}
    lines = before.replace(rows_fingerprint(project).encode(), b"0" * 16).splitlines(keepends=True)
    kept = [checked_line({k: v for k, v in json.loads(line).items() if k != "checksum"}) for line in lines[1:]]
    (project / "evaluations" / "0001-all-float.jsonl").write_bytes(
        before.splitlines(keepends=True)[0] + "".join(kept).encode()
    )
    report(project, measure)
    assert measure.asked[2:] == [("p", "all", 1)]
    assert measure.n_rows == 24  # pairs alone


def rows_fingerprint(project) -> str:
    header = read_clip_header(project / "clips" / "0000.safetensors")
    assert header is not None
    return header.fingerprint


@pytest.mark.slow
def test_rounded_pictures_are_measured_and_kept_by_themselves(project):
    measure = Measure()
    report(project, measure)
    report(project, measure, precision="8bit")
    page = Page(report(project, measure, precision="8bit").read_text(encoding="utf-8"))
    assert ["Figures", "all columns, pictures compared as 8bit"] in page.tables["setup"]
    assert measure.asked == [("p", "all", 0), ("p", "all", 1)] * 2
    report(project, measure)
    assert len(measure.asked) == 4


@pytest.mark.slow
def test_compared_projects_are_measured_quickly_unless_all_is_there(project, tmp_path, capture_folder):
    train(tmp_path / "more" / "a", capture_folder)
    train(tmp_path / "more" / "b", capture_folder)
    measure = Measure()
    report(tmp_path / "more" / "a", measure)
    page = Page(report(project, measure, compare=[tmp_path / "more"]).read_text(encoding="utf-8"))
    assert measure.asked[::2] == [("a", "all", 0), ("p", "all", 0), ("b", "quick", 0)]
    assert [row[-1] for row in page.tables["comparison"]] == ["all", "all", "quick"]
    report(project, measure, compare=[tmp_path / "more"], metrics="all")
    assert measure.asked[6:] == [("b", "all", 0), ("b", "all", 1)]


def test_where_a_project_cannot_be_written_to_figures_are_measured_and_that_is_said(project, tmp_path):
    (project / "evaluations").touch()  # a file where the folder would be
    measure, said = Measure(), []
    for _ in range(2):
        report(project, measure, out=tmp_path / "out", say=said.append)
    assert measure.asked == [("p", "all", 0), ("p", "all", 1)] * 2
    assert all("Figures are not kept (" in words for words in said)
