"""The documents say what is there: links lead somewhere, and generated blocks are what the code would generate now."""

import re
from pathlib import Path

import pytest

from tests.documents.blocks import GENERATORS, ROOT, block_names, documents, filled
from tests.documents.commands import command_sections
from tests.documents.keys import key_tables
from tests.documents.settings import presets_table, settings_tables
from tests.documents.table import table

LINK = re.compile(r"\]\(([^)#\s]*)(?:#([^)\s]+))?\)")
HEADING = re.compile(r"^#+ (.+)$", re.MULTILINE)
DOCUMENTS = [path.relative_to(ROOT).as_posix() for path in documents()]


def anchors(text: str) -> set[str]:
    """What links to the headings of `text` are called, as GitHub does it."""
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in HEADING.findall(text)}


def dead_links(path: Path) -> list[str]:
    """Relative Markdown links of a document to files or headings that do not exist."""
    dead = []
    for name, anchor in LINK.findall(path.read_text("utf-8")):
        target = path.parent / name if name else path
        if "://" in name or (target.exists() and (not anchor or anchor in anchors(target.read_text("utf-8")))):
            continue
        dead.append(f"{name}#{anchor}".rstrip("#"))
    return dead


@pytest.mark.parametrize("name", DOCUMENTS)
def test_links_lead_somewhere(name: str) -> None:
    assert dead_links(ROOT / name) == []


def test_dead_link_is_seen(tmp_path: Path) -> None:
    (tmp_path / "there.md").write_text("## One `a`, two\n", "utf-8")
    here = tmp_path / "here.md"
    here.write_text("[a](there.md#one-a-two) [b](gone.md) [c](https://host/x) [d](there.md#three) [e](#here)", "utf-8")
    assert dead_links(here) == ["gone.md", "there.md#three", "#here"]


@pytest.mark.parametrize("name", DOCUMENTS)
def test_generated_blocks_are_up_to_date(name: str) -> None:
    text = (ROOT / name).read_text("utf-8")
    assert filled(text) == text, "run `make docs` and commit what it changes"


def test_every_generated_block_is_in_a_document() -> None:
    found = [block for name in DOCUMENTS for block in block_names((ROOT / name).read_text("utf-8"))]
    assert sorted(found) == sorted(GENERATORS)


def test_a_block_that_is_out_of_date_is_seen_and_the_text_around_it_stays() -> None:
    text = "above\n<!-- generated: keys -->\n| `Q` | gone |\n<!-- end -->\nbelow\n"
    new = filled(text)
    assert "gone" not in new
    assert new == f"above\n<!-- generated: keys -->\n{key_tables()}\n<!-- end -->\nbelow\n"
    with pytest.raises(KeyError, match="nothing"):
        filled("<!-- generated: nothing -->\n<!-- end -->")


def test_blocks_hold_what_they_are_for() -> None:
    assert "| `Ctrl+T` | Stop training; progress is kept |" in key_tables()
    sections = command_sections()
    assert "### `clipgstream eval PROJECT --json OUT [options]`" in sections
    assert "| `--size WxH` | window size in pixels, for example 1440x900 |" in sections
    assert r"| `--metrics quick\|all` |" in sections
    assert "| `gaussians_per_anchor` | `5` | 1 to 32 Gaussians | Gaussians that each anchor is decoded to. |" in (
        settings_tables()
    )
    assert "| `passes` | 4 | 0 | 16 | 34 |" in presets_table()


def test_bars_inside_cells_do_not_end_them() -> None:
    assert table(("a", "b"), [("x|y", "z")]) == "| a | b |\n| --- | --- |\n| x\\|y | z |"


def test_every_group_of_keys_has_one_table():
    headings = [line for line in key_tables().splitlines() if line.startswith("**")]
    assert len(headings) == len(set(headings))
