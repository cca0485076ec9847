"""How fast projects are rendered, on the page, in its files and in the comparison."""

import json

from app.evaluation.headless import TrainedProject
from app.evaluation.speed.frame_rates import DEFINITION, FrameRates
from app.evaluation.speed.laps import RenderRate
from tests.app.lab.report.made_up import Page, report, train

CPU = RenderRate(21.57, 43.0, 70_645, 10, "CPU rasterizer, 2 threads")
GL = RenderRate(2.89, 3.1, 121_141, 8, "OpenGL, a card <&>")


def rates_of(opened: TrainedProject) -> FrameRates:
    """The page's own project has OpenGL, others have not."""
    if opened.project.folder.name == "p":
        return FrameRates("0", 48, 32, CPU, GL)
    return FrameRates("0", 48, 32, CPU, None, "no driver")


def test_rates_stand_with_what_they_depend_on(project):
    page = Page(report(project, rates_of=rates_of).read_text(encoding="utf-8"))
    assert page.tables["rendering"] == [
        ["p", "48 x 32", "0", CPU.drawn_by, "21.6", "43.0", "70645", "10", ""],
        ["p", "48 x 32", "0", GL.drawn_by, "2.9", "3.1", "121141", "8", ""],
    ]
    assert DEFINITION in page.text
    document = json.loads((project / "reports" / "report.json").read_text())
    assert document["projects"][0]["frame_rates"]["gl"]["fps"] == GL.fps
    assert (project / "reports" / "tables" / "rendering.csv").is_file()


def test_a_comparison_has_them_too_and_says_why_one_is_missing(project, tmp_path, capture_folder):
    other = train(tmp_path / "q", capture_folder)
    page = Page(report(project, compare=[other], rates_of=rates_of).read_text(encoding="utf-8"))
    assert [row[-1] for row in page.tables["rendering"]] == ["", "", "", "no driver"]
    document = json.loads((project / "reports" / "report.json").read_text())
    rows = document["tables"]["comparison"]["rows"]
    assert [row["fps_cpu"] for row in rows] == [CPU.fps, CPU.fps]
    assert [row["fps_gl"] for row in rows] == [GL.fps, None]
    assert [row["n_gaussians"] for row in rows] == [70_645, 70_645]


def test_without_them_nothing_is_said(project):
    page = Page(report(project).read_text(encoding="utf-8"))
    assert "rendering" not in page.tables
    assert json.loads((project / "reports" / "report.json").read_text())["projects"][0]["frame_rates"] is None
