"""The report: one page that stands alone, its numbers, what it says when something is missing. Nothing is trained
or rendered; evaluation documents are put together from made-up rows by the real means."""

from __future__ import annotations

import base64
import csv
import io
import json
import random
import shutil
from collections.abc import Callable
from functools import partial
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from app.cli import main
from app.project import create_project, default_settings
from app.report import write
from app.report.cache import evaluation_of
from app.report.charts import draw_pictures
from app.report.facts import read_facts, short_names
from app.report.markup import escaped, tag
from app.report.measured import clip_borders, worst_pictures
from app.report.pareto import pareto_front
from app.report.storage import storage_of
from app.report.tables import Table, TableColumn, value_text
from app.report.write import write_report
from engine.capture.capture import open_capture
from engine.errors import ProjectError
from engine.metrics import seams, summary
from engine.metrics.columns import COLUMNS
from engine.metrics.seams import PairRow, SeamMaps
from engine.metrics.summary import EvalRow
from engine.model.clip_state import ClipState, read_clip_state, write_clip_state
from tests.app.fakes import N_STEPS, FakeTraining, write_capture

ODD_NAME = "a <i>&\"'$x$ é"
CAMERAS = ("0", "1", "2", "3")


class Measure:
    """Stands in for evaluate_project: made-up figures, real means; counts how often it is asked."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, str]] = []

    def __call__(self, opened, *, clip_indices, metrics="all", precision="float", on_progress) -> dict[str, Any]:
        self.asked.append((opened.project.folder.name, metrics))
        draw = random.Random(len(opened.project.folder.name)).random
        rows, pairs = [], []
        for clip_index in clip_indices:
            for frame in opened.clips[clip_index].frame_indices():
                for camera in CAMERAS:
                    missing = {name: "no network here" for name in COLUMNS if name.startswith("lpips")}
                    if metrics == "quick":
                        missing = {name: "quick choice" for name, c in COLUMNS.items() if not c.is_quick}
                    figures = {
                        name: None if name in missing else (20.0 if column.unit == "dB" else 0.0) + draw()
                        for name, column in COLUMNS.items()
                    }
                    rows.append(
                        EvalRow(clip_index, frame, camera, camera in opened.project.settings.holdout, figures, missing)
                    )
                    if frame > 0 and (frame != opened.clips[clip_index].start or clip_index - 1 in clip_indices):
                        pairs.append(
                            PairRow(
                                frame, clip_index, camera, camera in opened.project.settings.holdout,
                                frame == opened.clips[clip_index].start,
                                *(draw() * 0.01 for _ in range(6)), static_share=0.9,
                            )
                        )  # fmt: skip
        on_progress(len(rows), len(rows), rows[-1])
        return {
            "schema": 1,
            "holdout": list(opened.project.settings.holdout),
            "clips": list(clip_indices),
            "metrics": metrics,
            "precision": precision,
            "columns": summary.columns_of(rows),
            "rows": [row.as_dict() for row in rows],
            "means": {
                "all": summary.means(rows),
                **summary.by_group(rows),
                "clips": {str(i): summary.by_group([r for r in rows if r.clip_index == i]) for i in clip_indices},
                "cameras": summary.by_camera(rows),
                "frames": summary.by_frame(rows),
                "worst": summary.worst_by_group(rows),
            },
            "seams": {"rows": [pair.as_dict() for pair in pairs], **seams.summarize(pairs)},
        }


class FakePictures:
    """Noise of the capture's size."""

    def __init__(self, opened) -> None:
        self._rng = np.random.default_rng(0)

    def pair(self, clip_index, frame_index, camera):
        return self._rng.integers(0, 255, (24, 32, 3), dtype=np.uint8), self._rng.random((24, 32, 3), np.float32)

    def seam(self, clip_index, camera):
        change, truth = self._rng.random((2, 24, 32), np.float32) * 0.1
        return SeamMaps(change, truth, np.maximum(change - truth, 0), truth < 0.05)


class Page(HTMLParser):
    """Reads a page and sees to it that every element is closed where it has to be."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.tables: dict[str, list[list[str]]] = {}
        self.text, self._table = "", ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        name = tag
        self.tags.append((name, dict(attrs)))
        assert len(attrs) == len(dict(attrs)), f"an attribute stands twice in {name}"
        if name in ("img", "meta"):
            return
        self.open.append(name)
        if name == "table":
            self._table = str(dict(attrs)["id"]).removeprefix("table-")
            self.tables[self._table] = []
        elif name == "tr" and "tbody" in self.open:
            self.tables[self._table].append([])
        elif name == "td":
            self.tables[self._table][-1].append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if "style" not in self.open:
            self.text += data
        if "td" in self.open:
            self.tables[self._table][-1][-1] += data

    def attributes(self, name: str) -> list[dict[str, str | None]]:
        return [attributes for found, attributes in self.tags if found == name]


def train(
    folder: Path, capture: Path, *, n_clips: int = 2, holdout: tuple[str, ...] = ("0",), **overrides: object
) -> Path:
    """A project with finished clips of three frames, without times."""
    opened = open_capture(capture)
    project = create_project(folder, default_settings(opened, clip_length=3, holdout=holdout, overrides=overrides))
    reference = None
    for clip in project.clips(opened.n_frames)[:n_clips]:
        training = FakeTraining(opened, clip, reference, lambda progress: None)
        for _ in range(N_STEPS):
            training.step()
        write_clip_state(project.clip_path(clip.clip_index), training.state())
        reference = reference or training.state()
    project.close()
    return folder


def change_header(path: Path, change: Callable[[dict[str, Any]], None]) -> None:
    state = read_clip_state(path)
    change(state.header)
    write_clip_state(path, ClipState(state.arrays, state.header))


def report(project: Path, measure: Callable[..., dict[str, Any]] | None = None, **options: Any) -> Path:
    stages: list[str] = []
    page = write_report(
        project,
        measure=measure or Measure(),
        make_pictures=FakePictures,
        on_stage=lambda stage, done, n: stages.append(stage),
        **options,
    )
    assert "Drawing" in stages
    return page


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a capture, a project with an odd name, one besides it, and the page of both."""
    folder = tmp_path_factory.mktemp("report")
    capture = write_capture(folder / "capture <i>")
    train(folder / ODD_NAME, capture)
    train(folder / "others" / "fast", capture, source_steps=7)
    for clip, seconds in ((0, 30.0), (1, 20.0)):
        for project, factor in ((folder / ODD_NAME, 1.0), (folder / "others" / "fast", 0.1)):
            metrics = {"stages_s": {"Carving": seconds * factor, "Training": 60.0 * factor}}
            metrics |= {"preparation_s": seconds * factor, "training_s": 60.0 * factor}
            change_header(project / "clips" / f"{clip:04d}.safetensors", lambda h, m=metrics: h.update(metrics=m))
    report(folder / ODD_NAME, compare=[folder / "others"])
    return folder


@pytest.fixture
def page(made: Path) -> Page:
    return Page((made / ODD_NAME / "reports" / "report.html").read_text(encoding="utf-8"))


@pytest.fixture
def numbers(made: Path) -> dict[str, Any]:
    return json.loads((made / ODD_NAME / "reports" / "report.json").read_text(encoding="utf-8"))


@pytest.fixture
def quick_charts(monkeypatch: pytest.MonkeyPatch) -> None:
    """For tests that look at words and numbers only."""
    buffer = io.BytesIO()
    Image.new("RGB", (2, 2)).save(buffer, "png")
    for module, names in {
        "measured": ("draw_over_time", "draw_pictures"),
        "seam_parts": ("draw_over_time", "draw_maps"),
        "costs": ("draw_stacked",),
        "comparison": ("draw_speed_error",),
    }.items():
        for name in names:
            monkeypatch.setattr(f"app.report.{module}.{name}", lambda *_args: buffer.getvalue())


@pytest.fixture
def project(tmp_path: Path, capture_folder: Path, quick_charts: None) -> Path:
    return train(tmp_path / "p", capture_folder)


# ---------------------------------------------------------------- the page


def test_the_page_needs_nothing_but_itself(page):
    names = {name for name, _ in page.tags}
    assert not names & {"script", "link", "iframe", "object", "base", "form", "i"}
    ids = [str(attributes["id"]) for _, attributes in page.tags if "id" in attributes]
    assert len(ids) == len(set(ids))
    links = [str(attributes["href"]) for attributes in page.attributes("a")]
    assert len(links) == len(page.attributes("section")) == 12
    assert all(link[0] == "#" and link[1:] in ids for link in links)
    assert not any(key.startswith("on") or key == "style" for _, attributes in page.tags for key in attributes)
    for image in page.attributes("img"):
        kind, _, data = str(image["src"]).partition(",")
        assert kind == "data:image/png;base64"
        with Image.open(io.BytesIO(base64.b64decode(data, validate=True))) as picture:
            assert picture.width > 200
        assert len(str(image["alt"])) > 20


def test_the_style_asks_for_nothing_either(made):
    text = (made / ODD_NAME / "reports" / "report.html").read_text(encoding="utf-8")
    style = text[text.index("<style>") : text.index("</style>")]
    assert "url(" not in style
    assert "@import" not in style
    assert "prefers-color-scheme: dark" in style


def test_names_are_shown_as_they_are(page, made):
    assert f"Report: {ODD_NAME}" in page.text
    assert page.tables["comparison"][0][0] == ODD_NAME
    assert ["Folder", str(made / "capture <i>")] in page.tables["capture"]


def test_the_comparison_stands_first(page):
    anchors = [attributes["id"] for attributes in page.attributes("section")]
    assert anchors[:2] == ["comparison", "speed"]
    assert [row[:2] for row in page.tables["comparison"]] == [[ODD_NAME, "defaults"], ["fast", "source_steps=7"]]
    assert page.tables["speed_error"][1][:3] == ["2", "fast", "0.28"]  # (3 + 6 + 2 + 6) / 60


def test_flicker_is_one_thing_on_the_whole_page(page, numbers):
    rows = [row for row in numbers["tables"]["seam_pairs"]["rows"] if row["is_held_out"]]
    inside, borders = (
        [row["change_static"] for row in rows if row["is_boundary"] == is_border] for is_border in (False, True)
    )
    expected = [255.0 * sum(values) / len(values) for values in (inside, borders)]
    own, compared = numbers["projects"][0]["flicker"], numbers["tables"]["comparison"]["rows"][0]
    for found in (own, compared):
        assert [found["flicker_inside"], found["flicker_borders"]] == pytest.approx(expected)
        assert found["seam_ratio_static"] == pytest.approx(expected[1] / expected[0])
    assert numbers["tables"]["speed_error"]["rows"][0]["flicker_inside"] == own["flicker_inside"]
    assert page.text.count("Flicker: mean change of the render (R)") == 2  # below the comparison and the marks


def test_page_csv_and_json_have_the_same_numbers(page, numbers, made):
    out = made / ODD_NAME / "reports"
    assert {"seams", "seam_pairs", "pictures", "frames", "clip_metrics", "storage", "times"} <= numbers["tables"].keys()
    for name, table in numbers["tables"].items():
        keys = [column["key"] for column in table["columns"]]
        with (out / "tables" / f"{name}.csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        expected = [{key: "" if row[key] is None else str(row[key]) for key in keys} for row in table["rows"]]
        assert rows == expected, name
        if name in page.tables:
            assert len(page.tables[name]) == len(table["rows"]), name
            for shown, row in zip(page.tables[name], table["rows"], strict=True):
                for text, key in zip(shown, keys, strict=True):
                    assert_shows(text, row[key])
    hidden = numbers["tables"].keys() - page.tables.keys()
    assert hidden == {"pictures", "frames", "seam_pairs"}
    assert len(numbers["tables"]["pictures"]["rows"]) == 6 * len(CAMERAS)
    for file in numbers["files"]:
        assert (out / file).is_file()
    assert len(page.attributes("img")) == sum(name.endswith(".png") for name in numbers["files"])


def assert_shows(text: str, value: Any) -> None:
    """The text of a cell is the value, rounded."""
    if isinstance(value, float):
        n_digits = len(text.partition("e")[0].partition(".")[2])
        assert float(text) == pytest.approx(value, rel=1e-4, abs=0.501 * 10.0**-n_digits if "e" not in text else 0)
    else:
        assert text == value_text(value, None)


def test_every_column_is_there_with_unit_direction_and_why_it_is_missing(page):
    rows = {row[0]: row for row in page.tables["clip_metrics"]}
    assert list(rows) == list(COLUMNS)
    assert rows["psnr_fit_moving"][1:3] == ["dB", "higher"]
    assert rows["flip"][1:3] == ["1", "lower"]
    assert rows["moving_share"][1:3] == ["1", ""]
    assert rows["lpips"][3:] == ["–"] * 6 + [f"no network here ({6 * len(CAMERAS)} pictures)"]
    assert rows["psnr"][-1] == ""


def test_bytes_and_seconds_add_up(page, made, numbers):
    for clip, row in zip(numbers["projects"][0]["clips"], page.tables["storage"], strict=False):
        path = made / ODD_NAME / "clips" / f"{clip['clip_index']:04d}.safetensors"
        assert sum(clip["storage_bytes"].values()) == path.stat().st_size == int(row[-1])
        assert clip["storage_bytes"]["positions"] == clip["storage_bytes"]["colours"] == 12 * 3 * 4
    assert page.tables["times"][0][1:] == ["6", "0.1", "30.0", "60.0", "0.0", "90.0"]
    assert ["Carving", "30.0", "20.0"] in page.tables["stages"]


# ---------------------------------------------------------------- what may be missing


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


def test_quick_figures_say_what_was_not_measured(project):
    page = Page(report(project, metrics="quick").read_text(encoding="utf-8"))
    rows = {row[0]: row for row in page.tables["clip_metrics"]}
    assert rows["flip"][-1] == "quick choice (24 pictures)"
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


# ---------------------------------------------------------------- measured once


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


# ---------------------------------------------------------------- comparing


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
        (["{tmp}/p", "--compare", "{tmp}/plain"], "is no project and holds none"),
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
    assert "fault of the program" not in message
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
    quick = partial(write_report, measure=Measure(), make_pictures=FakePictures)
    monkeypatch.setattr(write, "write_report", quick)
    assert main(["report", str(project), "--out", str(tmp_path / "out")]) == 0
    message = capsys.readouterr().err
    assert "Measuring p 100 %" in message
    assert f"Report: {tmp_path / 'out' / 'report.html'}" in message
    assert (tmp_path / "out" / "report.html").is_file()


def test_an_interrupted_report_keeps_what_was_measured_and_writes_no_page(
    project, tmp_path, capture_folder, monkeypatch, capsys
):
    train(tmp_path / "other", capture_folder)
    measure = Measure()

    def interrupted(opened, **options):
        if opened.project.folder.name == "other":
            raise KeyboardInterrupt
        return measure(opened, **options)

    monkeypatch.setattr(write, "write_report", partial(write_report, measure=interrupted, make_pictures=FakePictures))
    arguments = ["report", str(project), "--compare", str(tmp_path / "other"), "--quiet"]
    assert main(arguments) == 130
    assert "were measured to the end need not" in capsys.readouterr().err
    assert [path.name for path in (project / "reports").iterdir()] == ["eval-all.json"]


# ---------------------------------------------------------------- pieces


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
