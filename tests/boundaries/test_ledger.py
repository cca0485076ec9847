"""The ledger: its files can be read, their commands run as they are written, and figures in the text are theirs."""

from __future__ import annotations

import json
import re
import shlex

import msgspec
import pytest

from app.cli.cli import build_parser
from tests.documents import ledger
from tests.documents.blocks import ROOT
from tests.documents.ledger import LEDGER, NAMES, Entry, entry, headline_table, quality_table, write_entry

_ROW_OF_OURS = re.compile(r"\| this program, four clips \| 40 of 150 \| ([\d.]+) \| ([\d.]+) \|")


def test_every_file_is_shown():
    assert sorted(path.stem for path in LEDGER.glob("*")) == sorted(NAMES)
    for name in NAMES:
        assert f"[{name}.json](results/{name}.json)" in quality_table()


@pytest.mark.parametrize("name", NAMES)
def test_an_entry_is_whole(name: str):
    found = entry(name)
    assert re.fullmatch(r"[0-9a-f]{7,40}", found.commit)
    assert re.fullmatch(r"\d{4}-\d\d-\d\d", found.day)
    assert [row.clip_index for row in found.rows] == list(range(len(found.rows)))
    assert [row.is_reference for row in found.rows] == [True] + [False] * len(found.later)
    for row in found.rows:
        assert row.n_pictures > 0
        assert 15 < row.psnr_moving < row.psnr < row.psnr_rest < 45
        assert 0 < row.ssim < 1
        assert row.n_bytes > 10_000


@pytest.mark.parametrize("name", NAMES)
def test_commands_of_the_ledger_are_commands(name: str):
    for command in entry(name).commands:
        program, *arguments = shlex.split(command)
        assert program == "clipgstream"
        parsed = build_parser(arguments[:1]).parse_args(arguments)
        assert parsed.command == arguments[0]


def test_a_damaged_file_or_one_of_another_schema_is_refused(tmp_path, monkeypatch):
    content = json.loads((LEDGER / "sample.json").read_text("utf-8"))
    monkeypatch.setattr(ledger, "LEDGER", tmp_path)
    (tmp_path / "sample.json").write_text(json.dumps(content | {"schema": 0}), "utf-8")
    with pytest.raises(ValueError, match="schema 0"):
        entry("sample")
    for wrong in ({"seed": "none"}, {"by_hand": True}, {"rows": [{}]}):
        (tmp_path / "sample.json").write_text(json.dumps(content | wrong), "utf-8")
        with pytest.raises(msgspec.ValidationError):
            entry("sample")
    made = msgspec.convert(content, Entry)
    write_entry("again", made)
    assert entry("again") == made


def test_means_weigh_pictures_and_not_clips():
    made = entry("sample")
    first, second = made.rows[0], msgspec.structs.replace(made.rows[1], n_pictures=3 * made.rows[0].n_pictures)
    uneven = msgspec.structs.replace(made, rows=[first, second])
    assert uneven.mean("psnr") == pytest.approx((first.psnr + 3 * second.psnr) / 4)
    assert uneven.total("n_bytes") == first.n_bytes + second.n_bytes


def test_figures_beside_published_ones_are_those_of_the_ledger():
    found = _ROW_OF_OURS.search((ROOT / "docs" / "results.md").read_text("utf-8"))
    assert found is not None
    of_ours = entry("basketball")
    assert found.groups() == (f"{of_ours.mean('psnr'):.2f}", f"{of_ours.mean('ssim'):.3f}")


def test_the_readme_shows_what_was_measured():
    for line in headline_table().splitlines():
        assert line in (ROOT / "README.md").read_text("utf-8")
