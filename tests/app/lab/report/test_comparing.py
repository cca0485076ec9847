"""Projects set beside each other, the command, and what bad input leaves behind."""

from __future__ import annotations

import shutil
from functools import partial

import pytest

from app.cli.cli import main
from app.lab.report import write
from app.lab.report.write import write_report
from engine.errors import ProjectError
from tests.app.fakes import write_capture
from tests.app.lab.report.made_up import FakePictures, Measure, Page, report, train


def test_what_cannot_be_compared_is_said(project, tmp_path, capture_folder):
    other = write_capture(tmp_path / "other_capture", n_frames=9)
    train(tmp_path / "more" / "elsewhere", other)
    train(tmp_path / "more" / "deep" / "p", capture_folder, n_clips=1)
    shutil.copytree(project, tmp_path / "more" / "empty", ignore=shutil.ignore_patterns("*.safetensors"))
    page = Page(report(project, compare=[tmp_path / "more", project, tmp_path]).read_text(encoding="utf-8"))
    parent = project.parent.name
    assert [row[0] for row in page.tables["comparison"]] == [f"{parent}/p", "deep/p", "elsewhere"]
    assert "deep/p is measured on 3 frames, not the same 6" in page.text
    assert "elsewhere is of another capture" in page.text
    assert "empty is left out: Nothing is trained in this project yet." in page.text


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["{tmp}/nowhere"], "There is no such folder"),
        (["{tmp}/plain"], "no project"),
        (["{tmp}/untrained"], "Nothing is trained"),
        (["{tmp}/p", "--compare", "{tmp}/nowhere"], "no such folder"),
        (["{tmp}/p", "--compare", "{tmp}/plain"], "is not a project and holds none"),
        (["{tmp}/p", "--compare", "{tmp}/untrained"], "Nothing is trained"),
        (["{tmp}/p", "--out", "{tmp}/a_file"], "is a file"),
        (["{tmp}/p", "--metrics", "some"], "invalid choice"),
    ],
)
def test_bad_input_leaves_nothing_behind(arguments, expected, project, tmp_path, capsys):
    (tmp_path / "plain").mkdir()
    (tmp_path / "a_file").touch()
    shutil.copytree(project, tmp_path / "untrained", ignore=shutil.ignore_patterns("*.safetensors"))
    before = sorted(tmp_path.rglob("*"))
    assert main(["report", *(part.format(tmp=tmp_path) for part in arguments), "--quiet"]) == 2
    message = capsys.readouterr().err
    assert expected in message
    assert "bug in the program" not in message
    logs = {path for path in tmp_path.rglob("*") if "xdg" in str(path)}
    assert sorted(set(tmp_path.rglob("*")) - logs) == [path for path in before if path not in logs]


def test_a_report_that_cannot_be_finished_is_taken_back(project, tmp_path, monkeypatch):
    def refuse(path):
        if path.name == "report.html":
            raise OSError(28, "No space left on device")
        return real(path)

    real = write.atomic_path
    monkeypatch.setattr(write, "atomic_path", refuse)
    with pytest.raises(ProjectError, match="No space left"):
        report(project, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_the_command_writes_the_page(project, tmp_path, monkeypatch, capsys):
    quick = partial(write_report, measuring=Measure(), make_pictures=FakePictures)
    monkeypatch.setattr(write, "write_report", quick)
    assert main(["report", str(project), "--out", str(tmp_path / "out")]) == 0
    message = capsys.readouterr().err
    assert "Measuring p   0 %  0/24" in message
    assert "–" not in message
    assert f"Report: {tmp_path / 'out' / 'report.html'}" in message
    assert (tmp_path / "out" / "report.html").is_file()


def test_an_interrupted_report_says_what_is_kept_and_goes_on_from_there(project, monkeypatch, capsys):
    measure = Measure()

    def interrupted(opened, scope, clip_index, unknown):
        for n, item in enumerate(measure(opened, scope, clip_index, unknown)):
            if clip_index == 1 and n == 7:
                raise KeyboardInterrupt
            yield item

    def measured_by(work):
        def quick(*args, **options):
            return write_report(*args, **{**options, "measuring": work}, make_pictures=FakePictures)

        monkeypatch.setattr(write, "write_report", quick)

    measured_by(interrupted)
    assert main(["report", str(project), "--quiet"]) == 130
    said = capsys.readouterr().err
    assert "Interrupted. 16 of 24 pictures were measured and are kept; the same command resumes from there." in said
    assert "The page was not written." in said
    assert not (project / "reports").exists()
    measured_by(measure)
    n_before = measure.n_rows
    assert main(["report", str(project)]) == 0
    assert measure.n_rows - n_before == 24 - 16
    assert "16/24" in capsys.readouterr().err  # the work shown begins with what is kept
