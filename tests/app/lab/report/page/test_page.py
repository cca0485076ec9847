"""The page stands alone, and shows the same numbers as its files."""

from __future__ import annotations

import base64
import csv
import io
import json
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from app.lab.report.page.labels import FIGURE_LABELS
from app.lab.report.page.tables import value_text
from engine.metrics.columns import COLUMNS
from tests.app.fakes import write_capture
from tests.app.lab.report.made_up import CAMERAS, ODD_NAME, Page, change_header, report, train

pytestmark = pytest.mark.slow

COVERAGE = {
    "n_points": 4000,
    "n_inherited": 500,
    "n_residual": 3000,
    "n_left_out": 500,
    "share": 0.9876,
    "reason": "<3>",
}


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
            change_header(project / "clips" / f"{clip:04d}.safetensors", metrics=metrics)
    change_header(folder / ODD_NAME / "clips" / "0001.safetensors", coverage=COVERAGE)
    report(folder / ODD_NAME, compare=[folder / "others"])
    return folder


@pytest.fixture
def page(made: Path) -> Page:
    return Page((made / ODD_NAME / "reports" / "report.html").read_text(encoding="utf-8"))


@pytest.fixture
def numbers(made: Path) -> dict[str, Any]:
    return json.loads((made / ODD_NAME / "reports" / "report.json").read_text(encoding="utf-8"))


def test_the_page_needs_nothing_but_itself(page):
    names = {name for name, _ in page.tags}
    assert not names & {"script", "link", "iframe", "object", "base", "form", "i"}
    ids = [str(attributes["id"]) for _, attributes in page.tags if "id" in attributes]
    assert len(ids) == len(set(ids))
    links = [str(attributes["href"]) for attributes in page.attributes("a")]
    assert len(links) == len(page.attributes("section")) == 19
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
    assert [[row[0], row[-2]] for row in page.tables["comparison"]] == [
        [ODD_NAME, "defaults"],
        ["fast", "source_steps=7"],
    ]
    assert page.tables["speed_error"][1][:3] == ["2", "fast", "0.28"]  # (3 + 6 + 2 + 6) / 60


def test_what_a_later_clip_takes_and_gives_is_set_side_by_side(page, numbers):
    rows = numbers["tables"]["later_clips"]["rows"]
    assert [row["project"] for row in rows] == [ODD_NAME, "fast"]
    own = numbers["projects"][0]
    assert rows[1]["later_s"] == pytest.approx(8.0)  # clip 1 alone: 2 + 6
    assert page.tables["later_clips"][1][:3] == ["2", "fast", "8.0"]
    assert rows[0]["later_psnr"] != own["means"]["held_out"]["psnr"]


def test_the_split_says_how_much_of_what_moves_is_within_reach_of_an_anchor(page, numbers):
    assert page.tables["coverage"] == [["1", "4000", "500", "3000", "500", "0.988", "<3>"]]
    assert numbers["tables"]["coverage"]["rows"] == [{"clip": 1, **COVERAGE}]


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
                    assert_shows(text, FIGURE_LABELS.get(row[key], row[key]) if key == "figure" else row[key])
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
    assert list(rows) == list(FIGURE_LABELS.values())
    assert len(rows) == len(COLUMNS) + 3, "and LPIPS"
    assert rows["PSNR, moving pixels, after the colour fit"][1:3] == ["dB", "higher"]
    assert rows["FLIP"][1:3] == ["1", "lower"]
    assert rows["Share of moving pixels"][1:3] == ["1", ""]
    assert rows["DSSIM, multi-scale"][3:] == ["–"] * 6 + [f"too small here ({6 * len(CAMERAS)} pictures)"]
    assert rows["LPIPS"][3:] == ["–"] * 6 + [f"the package lpips is not installed ({6 * len(CAMERAS)} pictures)"]
    assert rows["PSNR"][-1] == ""


def test_bytes_and_seconds_add_up(page, made, numbers):
    for clip, row in zip(numbers["projects"][0]["clips"], page.tables["storage"], strict=False):
        path = made / ODD_NAME / "clips" / f"{clip['clip_index']:04d}.safetensors"
        assert sum(clip["storage_bytes"].values()) == path.stat().st_size == int(row[-1])
        assert clip["storage_bytes"]["positions"] == clip["storage_bytes"]["colours"] == 12 * 3 * 4
    assert page.tables["times"][0][1:] == ["6", "0.1", "30.0", "60.0", "0.0", "90.0"]
    assert ["Carving", "30.0", "20.0"] in page.tables["stages"]
