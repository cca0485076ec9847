"""What arguments mean: ranges, cameras, paths."""

import argparse
from types import SimpleNamespace
from typing import Any

import pytest

from app.cli.arguments import (
    EXIT_BAD_INPUT,
    PlainParser,
    parse,
    parse_cameras,
    parse_range,
    path_argument,
)
from engine.errors import ProjectError


@pytest.mark.parametrize(
    ("text", "expected"),
    [(":", range(0, 7)), ("2:5", range(2, 5)), ("3", range(3, 4)), ("4:", range(4, 7)), (":2", range(2))],
)
def test_ranges(text, expected):
    assert parse_range(text, 7, option="--frames", what="frames") == expected


@pytest.mark.parametrize("text", ["", "a:b", "-1:3", "3:2", "0:8", "7", "1:2:3"])
def test_ranges_that_are_none(text):
    with pytest.raises(ProjectError, match="frames 0 to 6"):
        parse_range(text, 7, option="--frames", what="frames")


def capture_of(*names: str) -> Any:
    """Only what `parse_cameras` looks at."""
    return SimpleNamespace(rig=SimpleNamespace(names=names))


@pytest.mark.parametrize(
    ("text", "expected"),
    [("a", ("a",)), ("2, a", ("c", "a")), ("1", ("1",)), ("none", ()), ("", ()), ("a,a,0", ("a",))],
)
def test_cameras_by_name_or_number_each_once(text, expected):
    assert parse_cameras(text, capture_of("a", "1", "c")) == expected


def test_a_camera_that_is_not_there_is_told_with_a_near_one():
    with pytest.raises(ProjectError, match=r"no camera 'cam3'. Did you mean cam03\?"):
        parse_cameras("cam3", capture_of("cam03", "left"))
    with pytest.raises(ProjectError, match="'7'") as found:
        parse_cameras("7", capture_of(*(f"c{i}" for i in range(7))))
    assert "numbers from 0 to 6" in found.value.hint


@pytest.mark.parametrize("text", ["", "  ", "a\0b", "x" * 5000])
def test_what_cannot_be_a_path_is_said_at_once(text):
    with pytest.raises(argparse.ArgumentTypeError):
        path_argument(text)


def test_a_path_need_not_exist(tmp_path):
    assert path_argument(str(tmp_path / "new")) == tmp_path / "new"
    (tmp_path / "file").touch()
    assert path_argument(str(tmp_path / "file" / "below")).name == "below"  # said better by whoever uses it


def test_options_are_written_in_full_and_near_ones_are_named(capsys):
    parser = PlainParser(prog="clipgstream")
    parser.add_argument("--seeds", type=int)
    assert parse(parser, ["--seeds", "3"]).seeds == 3
    with pytest.raises(SystemExit) as ended:
        parse(parser, ["--seed", "3"])
    assert ended.value.code == EXIT_BAD_INPUT
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "unrecognized arguments: --seed 3. Did you mean --seeds? See" in said
