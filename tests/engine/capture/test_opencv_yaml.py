"""YAML as OpenCV writes it: what it may hold, and what is refused with its line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from engine.capture.cameras.opencv_yaml import YamlError, number, parse_opencv_yaml, read_opencv_yaml
from engine.errors import CaptureError

FILE = """%YAML:1.0
---
# a comment
names:
   - "00"
   - cam 1
   - '010'
flow: [ a, "b", 3.,
    4 ]
H_00: 1080.0000000000
K_00: !!opencv-matrix
   rows: 2
   cols: 3
   dt: d
   data: [ 1., 2.5e-03, -.5,
       .Nan, -.Inf, 6 ]   # to the end
"quoted: key": "a: b # c"
empty:
...
"""


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_everything_that_is_written_is_read(ending: str) -> None:
    found = parse_opencv_yaml(FILE.replace("\n", ending).encode())
    assert found["names"] == ["00", "cam 1", "010"]  # texts, never octal numbers
    assert found["flow"] == ["a", "b", "3.", "4"]
    assert number(found["H_00"]) == 1080
    assert np.array_equal(found["K_00"], [[1, 2.5e-3, -0.5], [np.nan, -np.inf, 6]], equal_nan=True)
    assert found["quoted: key"] == "a: b # c"
    assert found["empty"] == []
    assert number(found["names"]) is None
    assert number("1_000") is None
    assert parse_opencv_yaml(b"") == parse_opencv_yaml(b"\n" * 100_000) == {}


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("H_00: 1080.0000000000", "H_00: *other", "line 10 has '*other'"),
        ("H_00: 1080.0000000000", "H_00: {a: 1}", "line 10"),
        ("H_00: 1080.0000000000", "H_00 1080", "line 10 is 'H_00 1080', not a name"),
        ("H_00: 1080.0000000000", "names: 3", "'names' occurs twice, in line 10"),
        ("H_00: 1080.0000000000", "\tH_00: 3", "line 10 is indented with tabs"),
        ("H_00: 1080.0000000000", "  H_00: 3", "line 10 is"),
        ("!!opencv-matrix", "!!python/object:os.system", "which is not supported"),
        ("!!opencv-matrix", "&anchor !!opencv-matrix", "which is not supported"),
        ("rows: 2", "rows: 3", "has 6 numbers, not '3' x '3'"),
        ("rows: 2", "rows: -2", "not '-2' x '3'"),
        ("rows: 2", "rows: 2\n   rows: 2", "'rows' occurs twice"),
        ("   cols: 3\n", "", "no rows, cols or data"),
        ("dt: d", "dt: 2d", "not single numbers"),
        ("-.5", "word", "does not hold only numbers"),
        ("-.5", "[1]", "is nested"),
        ("-.5", "", "an empty item"),
        ("6 ]   # to the end", "6", "does not end"),
        ('"a: b # c"', '"a: b', "the quotes in line"),
        ('   - "00"', '   - "\\x41"', "hold escapes"),
        ("data: [ 1.", "data: [ " + "1, " * 2000 + "1.", "more than 1,000 items"),
    ],
)
def test_what_is_not_is_refused_with_its_line(old: str, new: str, said: str) -> None:
    assert old in FILE
    with pytest.raises(YamlError) as caught:
        parse_opencv_yaml(FILE.replace(old, new, 1).encode())
    assert said in str(caught.value)


@pytest.mark.parametrize("text", [b"a" + b" " * 500_000 + b"b", b"a: [" + b"\n " * 200_000, b"-" * 500_000])
def test_lines_without_end_are_refused_in_few_words(text: bytes) -> None:
    with pytest.raises(YamlError) as caught:
        parse_opencv_yaml(text)
    assert len(str(caught.value)) < 300


def test_files_that_cannot_be_read_are_said(tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match="missing"):
        read_opencv_yaml(tmp_path / "intri.yml")
    (tmp_path / "intri.yml").write_bytes(b"\xff\xfe")
    with pytest.raises(CaptureError, match="byte 0 is not UTF-8"):
        read_opencv_yaml(tmp_path / "intri.yml")
    (tmp_path / "large.yml").write_bytes(bytes(5 << 20))
    with pytest.raises(CaptureError, match="at most"):
        read_opencv_yaml(tmp_path / "large.yml")
