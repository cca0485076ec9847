import json
import os
from pathlib import Path

import pytest

from engine.storage import json_files
from engine.storage.json_files import (
    CHECKSUM,
    JsonError,
    checked_line,
    json_text,
    parse_json,
    read_checked_json,
    read_checked_lines,
    read_json_object,
    write_checked_json,
)

DOCUMENT = {"name": "a", "scale": 0.1 + 0.2, "cameras": ("0", "1"), "state": 2**127 + 1, "inner": {"b": None}}


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (b"\xff", "byte 0 is not UTF-8"),
        (b"", "Expecting value in line 1, column 1"),
        (b'{"a": 1' + b"0" * 400 + b"}", "a whole number has 401 digits"),
        (b"[" + b"9" * 5000 + b"]", "a whole number has 5000 digits"),
        (b"[1e400]", "the number 1e400 is too large"),
        (b"[1" + b"0" * 400 + b".5]", "is too large"),
        (b"[NaN]", "NaN is not a number"),
        (b"[-Infinity]", "-Infinity is not a number"),
        (b'["\\ud800"]', "half a Unicode character"),
        (b"[" * 100_000, "nested more than 100 deep"),
        (b"[" * 101 + b"]" * 101, "nested more than 100 deep"),
        (b'{"a":' * 200 + b"1" + b"}" * 200, "nested more than 100 deep"),
    ],
)
def test_what_is_not_strict_json_is_refused_with_its_reason(text: bytes, reason: str) -> None:
    with pytest.raises(JsonError, match=reason):
        parse_json(text)


def test_what_is_strict_json_is_read() -> None:
    assert parse_json(b"[" * 100 + b"]" * 100)
    assert parse_json('["\\ud83d\\ude00", "' + "1" * 400 + '"]')[0] == "\U0001f600"
    assert parse_json(f"[{2**127}, 0.{'3' * 400}]") == [2**127, pytest.approx(1 / 3)]
    assert parse_json("[[], {}, " * 90 + "1" + "]" * 90)[0] == []


@pytest.mark.parametrize("text", ["null", "[]", "3", '"word"', "true"])
def test_an_object_is_expected_at_the_top(text: str, tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text(text)
    with pytest.raises(JsonError, match="not an object"):
        read_json_object(path)


def test_a_document_comes_back_without_its_checksum(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    write_checked_json(path, DOCUMENT, is_durable=True)
    assert read_checked_json(path) == DOCUMENT | {"cameras": ["0", "1"]}
    assert CHECKSUM in json.loads(path.read_text())


def test_every_changed_bit_of_a_document_is_refused_or_changes_no_value(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    write_checked_json(path, DOCUMENT)
    good, values = path.read_bytes(), read_checked_json(path)
    n_refused = 0
    for at in range(len(good)):
        for bit in range(8):
            bad = bytearray(good)
            bad[at] ^= 1 << bit
            path.write_bytes(bad)
            try:
                found = read_checked_json(path)
            except JsonError:
                n_refused += 1
            else:  # a space that became another one, or the entry's own name: nothing of what it is about changed
                assert {key: found.get(key) for key in values} == values
    assert n_refused > 6 * len(good)


def test_without_the_checksum_an_edit_is_accepted(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    write_checked_json(path, DOCUMENT)
    content = json.loads(path.read_text()) | {"name": "b"}
    path.write_text(json.dumps(content))
    with pytest.raises(JsonError, match="does not fit its checksum"):
        read_checked_json(path)
    content.pop(CHECKSUM)
    path.write_text(json.dumps(content))
    assert read_checked_json(path)["name"] == "b"


def test_a_bad_byte_costs_one_row(tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"
    rows = [{"step": i, "loss": 1.0 / (i + 1)} for i in range(5)]
    lines = [checked_line(row).encode() for row in rows]
    lines[1] = lines[1].replace(b"0.5", b"0.7")
    lines[3] = lines[3].replace(b"step", b"s\xffep")
    path.write_bytes(b"".join(lines) + lines[4][:9])  # the last one is being written
    assert read_checked_lines(path) == ([rows[0], rows[2], rows[4]], 2)


def test_rows_of_earlier_versions_are_read_up_to_the_first_that_has_a_checksum(tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"
    old, new = {"step": 1, "loss": float("inf")}, {"step": 2, "loss": 0.5}
    path.write_text(json.dumps(old) + "\n" + checked_line(new) + json.dumps(old) + "\n")
    assert read_checked_lines(path) == ([old, new], 1)


def test_only_regular_files_of_a_bounded_size_are_read(tmp_path: Path) -> None:
    pipe, device = tmp_path / "pipe", tmp_path / "device"
    os.mkfifo(pipe)
    device.symlink_to("/dev/zero")
    (tmp_path / "large").write_bytes(b" " * 2000 + b"{}")
    for path, reason in ((pipe, "a pipe or a device"), (device, "a pipe or a device"), (tmp_path, "a folder")):
        with pytest.raises(OSError, match=reason):
            read_json_object(path)
    with pytest.raises(OSError, match="2002 bytes, at most 1000"):
        read_json_object(tmp_path / "large", max_bytes=1000)
    with pytest.raises(OSError, match="not a file name"):
        read_json_object(tmp_path / "a\0b")
    with pytest.raises(FileNotFoundError):
        read_json_object(tmp_path / "none")


def test_content_and_folder_are_flushed_around_the_rename(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []
    real_fsync, real_replace = os.fsync, os.replace

    def fsync(handle: int) -> None:
        done.append("folder" if os.path.isdir(f"/proc/self/fd/{handle}") else "file")
        real_fsync(handle)

    def replace(source: Path, target: Path) -> None:
        done.append("rename")
        real_replace(source, target)

    monkeypatch.setattr(os, "fsync", fsync)
    monkeypatch.setattr(os, "replace", replace)
    write_checked_json(tmp_path / "a.json", {})
    assert done == ["rename"]
    write_checked_json(tmp_path / "a.json", {}, is_durable=True)
    assert done == ["rename", "file", "rename", "folder"]
    assert json_files.read_checked_json(tmp_path / "a.json") == {}


def test_json_for_others_has_null_where_there_is_no_number_and_is_ascii() -> None:
    found = json_text({"a": [float("nan"), 1.5, (float("inf"),)], "b": {"c": -float("inf")}, "d": "half \ud800 \x1b"})
    assert json.loads(found) == {"a": [None, 1.5, [None]], "b": {"c": None}, "d": "half \ud800 \x1b"}
    assert found.isascii()
    assert found.isprintable()
