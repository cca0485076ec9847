"""The ledger: its files can be read, their commands run as they are written, and what README says comes from them."""

from __future__ import annotations

import importlib.util
import json
import re
import shlex

import msgspec
import pytest

from app.cli.cli import build_parser
from app.cli.commands import COMMANDS
from tests.benchmarks.figures import TABLES, forecast
from tests.documents import ledger
from tests.documents.blocks import ROOT
from tests.documents.fingerprint import changed_settings, default_settings, differences, fingerprint
from tests.documents.ledger import (
    HEADLINE,
    LEDGER,
    ClipsEntry,
    Entry,
    clips_entry,
    entry,
    names,
    quality_table,
    table_entry,
    write_entry,
)
from tests.documents.printed import printed_tables

UNITS = r"(?:dB|GB|MB|kB|ms|s|min|minutes?|seconds?|hours?|FPS|%|degrees|times)"
_FIGURE = re.compile(rf"(?<![\w.])\d[\d.,]*(?: to \d[\d.,]*)?\s?{UNITS}(?![\w])")
NOT_MEASURED = {"2.5 GB": "size of the environment, as setup.sh says it", "30 degrees": "a limit of calibration.md"}
"""Figures of README that no measurement is behind, and what they are."""


def unsourced(text: str) -> list[str]:
    """Figures with units in a document outside of what is generated, and of code."""
    written = re.sub(r"<!-- generated.*?<!-- end -->|```.*?```|`[^`]*`", "", text, flags=re.DOTALL)
    return [found for found in _FIGURE.findall(written) if found not in NOT_MEASURED]


def hand_written_tables(text: str) -> list[str]:
    """First lines of tables outside of what is generated."""
    written = re.sub(r"<!-- generated.*?<!-- end -->", "", text, flags=re.DOTALL)
    return re.findall(r"(?:^|\n\n)(\|.*)", written)


def test_readme_has_no_figure_without_a_source():
    assert unsourced((ROOT / "README.md").read_text("utf-8")) == []


def test_a_figure_without_a_source_is_seen():
    text = "It takes 43 s, 1.2 to 2.4 MB\n<!-- generated: x -->\n9 dB\n<!-- end -->\n```\nrun 3 s\n``` two 2D views"
    text += ", `4 s`, 31.1 dB."
    assert unsourced(text) == ["43 s", "1.2 to 2.4 MB", "31.1 dB"]


def test_tables_of_results_come_from_the_ledger():
    without_figures = ["| word | means |", "| operation | marks | time | error |"]
    assert hand_written_tables((ROOT / "docs" / "results.md").read_text("utf-8")) == without_figures
    assert hand_written_tables("a\n\n| b | c |\n|---|---|\n<!-- generated: x -->\n\n| d |\n<!-- end -->\n") == [
        "| b | c |"
    ]


def test_every_file_is_made_by_a_command_or_says_that_it_is_copied():
    for name in names():
        assert name in TABLES or entry(name).is_copied, f"{name}.json is from nowhere"


@pytest.mark.parametrize("name", names())
def test_an_entry_is_whole(name: str):
    found = entry(name)
    assert re.fullmatch(r"[0-9a-f]{7,40}", found.commit) or (found.is_copied and not found.commit)
    assert re.fullmatch(r"\d{4}-\d\d-\d\d", found.day)
    assert found.rows
    if not isinstance(found, ClipsEntry):
        assert all(len(row) == len(found.columns) for row in found.rows)
        return
    assert (name in quality_table()) == (name in HEADLINE)
    assert [row.clip_index for row in found.rows] == list(range(len(found.rows)))
    assert [row.is_reference for row in found.rows] == [True] + [False] * len(found.later)
    for row in found.rows:
        assert row.n_pictures > 0
        assert 15 < row.psnr_moving < row.psnr < row.psnr_rest < 45
        assert 0 < row.ssim < 1
        assert row.n_bytes > 10_000


@pytest.mark.parametrize("name", names())
def test_commands_of_the_ledger_are_commands(name: str):
    for command in entry(name).commands:
        program, *arguments = shlex.split(command)
        if program == "clipgstream":
            assert build_parser(used=COMMANDS).parse_args(arguments).command == arguments[0]
        elif program == "make":
            assert f"\n{arguments[0]}:" in (ROOT / "Makefile").read_text("utf-8")
        else:
            assert (program, arguments[0]) == ("python", "-m")
            assert importlib.util.find_spec(arguments[1]) is not None


@pytest.mark.slow
def test_headline_figures_are_of_this_engine(tmp_path):
    now = fingerprint(tmp_path / "sample")
    for name in HEADLINE:
        then = clips_entry(name)
        assert then.fingerprint
        found = changed_settings(then.settings) + differences(then.fingerprint, now)
        assert found == [], (
            f"The engine trains the sample otherwise than when {name}.json was measured ({then.day}): "
            f"measure it again with `python -m tests.benchmarks.figures OUT {name}`, see `make figures`"
        )


def test_a_fingerprint_bears_rounding_and_sees_changes():
    then = {"0.a": (1000, 0.5), "0.b": (10, 2.0)}
    assert differences(then, {"0.a": (1024, 0.52), "0.b": (10, 2.0)}) == []
    assert differences(then, {"0.a": (1060, 0.5), "0.b": (10, 2.2)}) == [
        "0.a has 1060 values, not 1000",
        "0.b is 2.2 in the mean, not 2",
    ]
    assert differences(then, {"0.a": (1000, 0.5)}) == ["0.b is in one only"]


def test_another_default_is_seen():
    then = default_settings()
    assert changed_settings(then | {"passes": 7.0, "gone_since": 1}) == [f"passes is {then['passes']}, not 7.0"]


def test_a_damaged_file_or_one_of_another_schema_is_refused(tmp_path, monkeypatch):
    content = json.loads((LEDGER / "sample.json").read_text("utf-8"))
    monkeypatch.setattr(ledger, "LEDGER", tmp_path)
    (tmp_path / "sample.json").write_text(json.dumps(content | {"schema": 0}), "utf-8")
    with pytest.raises(ValueError, match="schema 0"):
        entry("sample")
    for wrong in ({"seeds": "none"}, {"by_hand": True}, {"rows": [{}]}, {"kind": "other"}):
        (tmp_path / "sample.json").write_text(json.dumps(content | wrong), "utf-8")
        with pytest.raises(msgspec.ValidationError):
            entry("sample")
    made = msgspec.json.decode(json.dumps(content), type=Entry)
    write_entry("again", made)
    assert entry("again") == made
    with pytest.raises(ValueError, match="clips, not a table"):
        table_entry("again")


def test_means_weigh_pictures_and_not_clips():
    made = clips_entry("sample")
    first, second = made.rows[0], msgspec.structs.replace(made.rows[1], n_pictures=3 * made.rows[0].n_pictures)
    uneven = msgspec.structs.replace(made, rows=[first, second])
    assert uneven.mean("psnr") == pytest.approx((first.psnr + 3 * second.psnr) / 4)
    assert uneven.total("n_bytes") == first.n_bytes + second.n_bytes


def test_a_cell_is_found_by_row_and_column():
    made = table_entry("far-clips")
    assert made.cell("1 (10 to 19)", "still, fit") == made.rows[1][4]
    for row, column in (("no such clip", "still, fit"), ("1 (10 to 19)", "no such figure")):
        with pytest.raises(LookupError):
            made.cell(row, column)


def test_a_forecast_adds_what_is_known(tmp_path, monkeypatch):
    made = clips_entry("sample")
    monkeypatch.setattr(ledger, "LEDGER", tmp_path)
    monkeypatch.setattr("tests.benchmarks.figures.LEDGER", tmp_path)
    write_entry("sample", msgspec.structs.replace(made, took_s=300.0))
    write_entry("length", msgspec.structs.replace(table_entry_of(), took_s=None))
    assert forecast(["sample", "length", "mending"]) == (
        "sample, length, mending: about 5 minutes, as long as the last time; not known of length, mending"
    )


def table_entry_of() -> ledger.TableEntry:
    """A table that was never timed."""
    return ledger.TableEntry(
        title="t", commands=[], commit="", day="", machine="", seeds=[], columns=["a"], rows=[["b"]]
    )


def test_tables_are_found_in_what_a_command_prints():
    text = (
        "three words here\n\n| a | b |\n|---|---|\n| 1 | two, 3 |\n| c\\|d | |\n\n"
        "scene   size  ms (min)\n-----------------\nsmall   1x1   2.0 (1.0)\nlarge   2x2   3.0 (2.0)\n  \n"
        "An end.  It is.  Not one.\n"
    )
    assert printed_tables(text) == [
        [["a", "b"], ["1", "two, 3"], ["c|d", ""]],
        [["scene", "size", "ms (min)"], ["small", "1x1", "2.0 (1.0)"], ["large", "2x2", "3.0 (2.0)"]],
    ]
