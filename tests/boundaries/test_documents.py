"""README and ARCHITECTURE say what is there: links lead somewhere, keys and commands are the real ones."""

import ast
import re
from pathlib import Path

import pytest

from engine.training import config

ROOT = Path(__file__).resolve().parents[2]
LINK = re.compile(r"\]\(([^)#\s]+)\)")
TREE_ENTRY = re.compile(r"^( *)([\w.{},*-]+/?)(?:  |$)")


def dead_links(text: str, folder: Path) -> list[str]:
    """Targets of relative Markdown links in `text` that do not exist below `folder`."""
    targets = [target for target in LINK.findall(text) if "://" not in target]
    return [target for target in targets if not (folder / target).exists()]


def tree_of(text: str) -> set[str]:
    """Paths named by the first indented tree (two spaces a level) below the heading "Tree" of ARCHITECTURE.md."""
    block = text.split("## Tree", 1)[1].split("```")[1]
    paths: set[str] = set()
    parents: list[str] = []
    for line in block.splitlines():
        if not (entry := TREE_ENTRY.match(line)):
            continue
        depth = len(entry[1]) // 2
        parents = [*parents[:depth], entry[2]]
        paths.add("".join(parents))
    return paths


def shortcut_rows() -> list[tuple[str, str]]:
    """(key, text) of every row of the table in ui/panels/shortcuts.py, read without importing ImGui."""
    tree = ast.parse((ROOT / "ui" / "panels" / "shortcuts.py").read_text("utf-8"))
    rows = []
    for node in ast.walk(tree):
        match node:
            case ast.Call(
                func=ast.Name(id="Shortcut"), args=[_, ast.Constant(value=str(key)), ast.Constant(value=str(text)), *_]
            ):
                rows.append((key, text))
    return rows


@pytest.mark.parametrize("name", ["README.md", "ARCHITECTURE.md", "CHANGELOG.md"])
def test_links_lead_somewhere(name: str) -> None:
    assert dead_links((ROOT / name).read_text("utf-8"), ROOT) == []


def test_dead_link_is_seen(tmp_path: Path) -> None:
    text = "[a](there.md) [b](gone.md) [c](https://host/x)"
    (tmp_path / "there.md").touch()
    assert dead_links(text, tmp_path) == ["gone.md"]


def test_architecture_names_every_folder_of_the_packages_and_nothing_that_is_gone() -> None:
    named = tree_of((ROOT / "ARCHITECTURE.md").read_text("utf-8"))
    assert [path for path in sorted(named) if not (ROOT / path).exists()] == []
    folders = {
        f"{path.parent.relative_to(ROOT).as_posix()}/"
        for package in ("app", "engine", "ui")
        for path in (ROOT / package).rglob("*.py")
    }
    assert sorted(folders - named) == []


def test_readme_lists_the_keys_of_the_window() -> None:
    rows = shortcut_rows()
    assert len(rows) > 10, "the table of shortcuts was not found"
    text = (ROOT / "README.md").read_text("utf-8")
    assert [f"| {key} | {what} |" for key, what in rows if f"| {key} | {what} |" not in text] == []


def test_readme_lists_the_options_of_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    """In the row of the command, or among the settings that commands share."""
    from app.cli.cli import build_parser
    from app.cli.commands import COMMANDS

    text = (ROOT / "README.md").read_text("utf-8")
    rows = [line for line in text.splitlines() if line.startswith("| `")]
    shared = text[text.index("Settings of `train` and `ablate`:") : text.index("| `--set` |")]
    for command in COMMANDS:
        with pytest.raises(SystemExit):
            build_parser(used=[command]).parse_args([command, "--help"])
        options = set(re.findall(r"^  (--[a-z-]+)", capsys.readouterr().out, re.MULTILINE))
        assert options, command
        said = "".join(row for row in rows if f"`{command}`" in row.split("|")[1] or f"clipgstream {command} " in row)
        settings = shared if command in ("train", "ablate") else ""
        assert sorted(o for o in options if not re.search(rf"{o}(?![a-z-])", said + settings)) == [], command


def test_readme_lists_the_switches_of_the_method_with_the_default_first() -> None:
    text = (ROOT / "README.md").read_text("utf-8")
    choices = config._CHOICES | {"independent": ("false", "true")}
    for name, values in choices.items():
        row = re.search(rf"^\| `{name}` \|(.*)\|$", text, re.MULTILINE)
        assert row is not None, name
        assert tuple(word for word in re.findall(r"`(\w+)`", row[1]) if word in values) == values, name
