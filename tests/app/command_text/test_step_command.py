"""What was done, copied as a command: carried out, it gives the same document."""

from __future__ import annotations

import io
import json
import random
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec import structs

from app.cli.cli import main
from app.command_text.step_command import step_command
from app.document.changes.note_changes import put_marker, set_label
from app.document.changes.world_changes import set_scale
from app.document.project_document import ProjectDocument, World
from app.project.opening.project_access import open_project
from app.project.project import Project
from app.scripting import scripted_project
from engine.capture.exclusions import ExcludedFrames, Exclusions
from engine.editing.actions import Delete, Hide
from engine.editing.edit import Edit, Everything, Scope, Sphere
from engine.gate.regions import GateRegion
from tests.app.command_text.documents import EDITS, HARD_NAMES, NAMES, STACKS
from tests.app.document.documents import random_fill
from tests.app.made_projects import make_project

TELL = "import json, sys; print(json.dumps([sys.argv[1:], sys.stdin.read()]))"


def numbered(edits: list[Edit]) -> tuple[Edit, ...]:
    return tuple(structs.replace(edit, edit_id=index + 1) for index, edit in enumerate(edits))


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """A project whose folder is hard to quote."""
    made = make_project(tmp_path_factory.mktemp("made") / 'it\'s 100 % "mine"')
    made.close()
    return made


def written(project: Project, document: ProjectDocument) -> None:
    """Let the project hold this document."""
    opened = open_project(project.folder)
    opened.change(document, "begin")
    opened.close()


def held(project: Project) -> ProjectDocument:
    return open_project(project.folder, is_writable=False).document


def pasted(line: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> int:
    """Let a real shell take the line apart, then carry the command out in this process."""
    (folder / "clipgstream").write_text(f"#!{sys.executable} -S\n{TELL}\n")
    (folder / "clipgstream").chmod(0o755)
    done = subprocess.run(
        ["sh", "-c", line],
        env={"PATH": f"{folder}:/usr/bin:/bin", "PYTHONIOENCODING": "utf-8"},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        check=True,
    )
    arguments, stdin = json.loads(done.stdout)
    monkeypatch.setattr(sys, "stdin", io.StringIO(stdin))
    return main(arguments)


def check(project: Project, before: ProjectDocument, after: ProjectDocument, monkeypatch, folder: Path) -> str:
    """Copy the step in both forms, carry each out, and compare. Returns the command line."""
    command = step_command(project.folder, before, after)
    if before == after:
        assert command is None
        return ""
    assert command is not None
    written(project, before)
    assert pasted(command.shell(is_windows=False), folder, monkeypatch) == 0
    assert held(project) == after
    written(project, before)
    monkeypatch.setattr(scripted_project, "use_kernel_cache", lambda: None)
    exec(compile(command.python, "pasted", "exec"), {"__name__": "__main__"})
    assert held(project) == after
    return " ".join(command.arguments[2:])


HEALTH = settings(
    max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)


@HEALTH
@given(STACKS, EDITS)
def test_a_new_edit(project, monkeypatch, tmp_path, stack, edit):
    before = replace(held(project), edits=numbered(stack))
    after = replace(before, edits=numbered([*stack, edit]))
    said = check(project, before, after, monkeypatch, tmp_path)
    assert ("--put" in said) == (not edit.is_on)


@pytest.mark.slow
@HEALTH
@given(STACKS.filter(bool), EDITS, st.integers(0, 3), st.integers(0, 3))
def test_a_changed_stack(project, monkeypatch, tmp_path, stack, edit, which, place):
    edits = list(numbered(stack))
    before = replace(held(project), edits=tuple(edits))
    chosen = edits[which % len(edits)]
    rest = [other for other in edits if other is not chosen]
    at = place % len(edits)
    other = structs.replace(edit, edit_id=chosen.edit_id, is_on=chosen.is_on)
    for after_edits, option in (
        ([*rest[:at], chosen, *rest[at:]], "--move-to"),
        (rest, "--remove"),
        ([structs.replace(one, is_on=one.is_on != (one is chosen)) for one in edits], "--o"),
        ([other if one is chosen else one for one in edits], "--replace"),
        (rest[::-1], None),
    ):
        said = check(project, before, replace(before, edits=tuple(after_edits)), monkeypatch, tmp_path)
        assert not said or option is None or option in said


def test_an_edit_with_a_fill(project, monkeypatch, tmp_path):
    plain = Edit(1, "", Sphere((0.0, 0.0, 0.0), 1.0), Delete())
    filled = structs.replace(plain, fill=random_fill(plain, random.Random(3)))
    later = structs.replace(filled, scope=Scope(0, 1))
    document = held(project)
    for before, after, option in ((plain, filled, "--put"), (filled, later, "--replace"), (later, plain, "--put")):
        old, new = (replace(document, edits=(edit,)) for edit in (before, after))
        assert option in check(project, old, new, monkeypatch, tmp_path)


@pytest.mark.slow
@HEALTH
@given(NAMES)
def test_a_name_may_hold_anything(project, monkeypatch, tmp_path, name):
    edit = Edit(1, "before", Everything(), Hide())
    before = replace(held(project), edits=(edit,))
    after = replace(before, edits=(structs.replace(edit, name=name),))
    check(project, before, after, monkeypatch, tmp_path)


def test_names_that_no_argument_can_hold_go_another_way(project, monkeypatch, tmp_path):
    edit = Edit(1, "", Everything(), Hide())
    before = replace(held(project), edits=(edit,))
    after = replace(before, edits=(structs.replace(edit, name="a\0b"),))
    assert "--put" in check(project, before, after, monkeypatch, tmp_path)


@pytest.mark.parametrize("name", HARD_NAMES)
def test_everything_else_of_a_document(project, monkeypatch, tmp_path, name):
    before = replace(held(project), edits=(), markers=(), labels=())
    after = set_label(put_marker(before, 3, name), "clip", "0", name)
    after = set_scale(after, 0.01)
    after = replace(
        after,
        exclusions=Exclusions(cameras=(name,), frames=(ExcludedFrames(None, 3, 5),)),
        regions=(GateRegion("static", (-1.0, 0.0, 0.0), (1.0, 2.0, 3.0)),),
        world=World((0.0, 1.0, 0.0), 0.5),
    )
    assert check(project, before, after, monkeypatch, tmp_path) == "--put -"


def test_what_is_said_can_be_read(project):
    before = replace(held(project), edits=())
    edit = Edit(1, "the lamp", Sphere((0.5, 0.0, -2.0), 0.3), Delete())
    command = step_command(Path("/somewhere/mine"), before, replace(before, edits=(edit,)))
    assert command is not None
    assert command.shell(is_windows=False) == (
        "clipgstream edit /somewhere/mine --delete --sphere 0.5 0.0 -2.0 0.3 --name 'the lamp'"
    )
    assert command.python == (
        "from clipgstream import Delete, Sphere, open_project\n\n"
        'if __name__ == "__main__":\n'
        "    with open_project('/somewhere/mine') as project:\n"
        "        project.apply_edit(Delete(), Sphere(center=(0.5, 0.0, -2.0), radius=0.3), name='the lamp')\n"
    )
