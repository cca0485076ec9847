"""clipgstream edit VERB: the time of the take on the command line, and what is wrong with its arguments."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from app.project.opening.project_access import open_project
from engine.timing.segment import Segment
from tests.app.residuals.conftest import make_project


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A project of a capture with frames 0 to 5."""
    return make_project(tmp_path)


def timing(folder: Path) -> tuple[Segment, ...]:
    return open_project(folder, is_writable=False).document.timing


def test_verbs_change_the_take_and_list_it(run, folder):
    for words, expected in (
        (("trim", "--frames", "1:6"), (Segment(1, 6),)),
        (("split", "--at", 3), (Segment(1, 3), Segment(3, 6))),
        (("speed", "--frames", "3:6", "--by", 0.5), (Segment(1, 3), Segment(3, 6, 0.5, 0.5))),
        (("order", "1,0"), (Segment(3, 6, 0.5, 0.5), Segment(1, 3))),
        (("reverse", "--frames", "1:3"), (Segment(3, 6, 0.5, 0.5), Segment(1, 3, is_reversed=True))),
        (("freeze", "--at", 1, "--for", 9), None),
        (("loop", "--frames", "3:6", "--times", 3, "--crossfade", 2), None),
        (("speed", "--frames", "2:3", "--by", 0.5, "--to", 2, "--ease", "smooth"), None),
    ):
        code, out, err = run("edit", folder, *words)
        assert (code, err) == (0, "")
        assert expected is None or timing(folder) == expected
    assert timing(folder) == (
        Segment(3, 6, 0.5, 0.5, repeats=3, crossfade_frames=2),
        Segment(2, 3, 0.5, 2.0, "smooth", is_reversed=True),
        Segment(1, 2, n_frozen=9),
    )
    assert "    2  frame 1 frozen for 9 frames" in out
    code, out, _ = run("edit", folder, "--history", "--json")
    found = json.loads(out)
    assert len(found["timing"]) == 3
    assert found["undo"] == "speed 0.5 to 2 of frame 2"
    assert run("edit", folder, "--undo", 3)[0] == 0
    assert run("edit", folder, "reset-time")[0] == 0
    assert timing(folder) == ()


@pytest.mark.parametrize(
    ("words", "cause"),
    [
        (("bogus",), "not a verb"),
        (("trim",), "--frames"),
        (("trim", "--frames", "9:4"), "empty or out of range"),
        (("trim", "--frames", "x"), "not a range"),
        (("trim", "--frames", "0:3", "--by", 2), "--by does not apply to trim"),
        (("trim", "--frames", "0:3", "--delete"), "options of edits"),
        (("trim", "--frames", "0:3", "--undo"), "options of edits"),
        (("trim", "3", "--frames", "0:3"), "'3'"),
        (("split", "--at", 0), "frame 0"),
        (("speed", "--by", 0), "0.01"),
        (("speed", "--by", "nan"), "nan"),
        (("freeze", "--at", 99), "not in the capture"),
        (("loop", "--frames", "0:2", "--crossfade", 2), "cross-fade"),
        (("order", "7"), "segment 7"),
        (("order", "a"), "--places is 'a'"),
        (("order",), "needs"),
        (("--by", 2), "without a verb"),
    ],
)
def test_bad_input_is_named_and_changes_nothing(run, folder, words, cause):
    code, out, err = run("edit", folder, *words)
    assert (code, out) == (2, "")
    assert cause in err
    assert timing(folder) == ()


def test_renders_and_exports_take_it_or_leave_it(run, folder, tmp_path):
    assert run("edit", folder, "freeze", "--at", 2, "--for", 5)[0] == 0
    code, _, err = run("render", folder, "--camera", 0, "--out", tmp_path / "v")
    assert code == 0
    assert "The take is edited in time: 3 segments, 10 frames" in err
    assert len(list((tmp_path / "v").iterdir())) == 10
    assert run("render", folder, "--camera", 0, "--out", tmp_path / "as", "--as-captured", "--quiet")[0] == 0
    assert len(list((tmp_path / "as").iterdir())) == 6
