"""Only regular files are opened, half-written ones are told apart, and what the disk says becomes a typed error."""

import errno
import os
import socket
import time

import pytest

from engine.storage.files import (
    PARTIAL_PREFIX,
    STALE_AFTER_S,
    atomic_path,
    check_regular,
    disk_error,
    is_left_over,
    open_regular,
    open_to_append,
    read_bytes,
    replace_file,
)
from engine.storage.process_space import process_space


def test_a_pipe_is_refused_without_waiting_for_its_writer(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for read in (open_regular, check_regular):
        with pytest.raises(OSError, match="a pipe or a device"):
            read(tmp_path / "pipe")


def test_lines_go_to_a_regular_file_under_the_name_itself(tmp_path):
    for line in ("one", "two"):
        with open(open_to_append(tmp_path / "log"), "a") as file:
            file.write(f"{line}\n")
    assert (tmp_path / "log").read_text() == "one\ntwo\n"
    (tmp_path / "link").symlink_to(tmp_path / "log")
    os.mkfifo(tmp_path / "pipe")
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(tmp_path / "socket"))
    for name, said in (("link", "a symbolic link"), ("pipe", "a pipe or a device"), ("socket", "a pipe or a device")):
        with pytest.raises(OSError, match=said):
            open_to_append(tmp_path / name)
    with pytest.raises(OSError, match="a pipe or a device"):
        open_to_append("/dev/null")
    assert (tmp_path / "log").read_text() == "one\ntwo\n"


@pytest.mark.parametrize("read", [open_regular, check_regular])
def test_folders_missing_files_and_impossible_names_are_told_in_words(tmp_path, read):
    with pytest.raises(IsADirectoryError, match="a folder, not a file"):
        read(tmp_path)
    with pytest.raises(FileNotFoundError):
        read(tmp_path / "missing")
    with pytest.raises(OSError, match="not a file name"):
        read(f"{tmp_path}/a\0b")


def test_a_refused_file_leaves_no_handle_open(tmp_path):
    before = len(os.listdir("/proc/self/fd")) if os.path.isdir("/proc/self/fd") else 0
    for _ in range(5):
        with pytest.raises(OSError, match="a folder"):
            open_regular(tmp_path)
    assert (len(os.listdir("/proc/self/fd")) if before else 0) == before


def test_a_file_is_read_up_to_its_bound(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"x" * 10)
    assert check_regular(path) == 10
    assert read_bytes(path, max_bytes=10) == b"x" * 10
    with pytest.raises(OSError, match="10 bytes, at most 9 are read") as found:
        read_bytes(path, max_bytes=9)
    assert found.value.errno == errno.EFBIG


@pytest.mark.parametrize(
    ("name", "is_alive", "age_s", "expected"),
    [
        (f"{PARTIAL_PREFIX}77-a", True, 0, False),
        (f"{PARTIAL_PREFIX}77-a", False, 0, True),
        (f"{PARTIAL_PREFIX}77-a", True, STALE_AFTER_S + 60, True),
        (f"{PARTIAL_PREFIX}seven-a", False, 0, False),
        (f"{PARTIAL_PREFIX}77@{process_space()}-a", False, 0, True),
        (f"{PARTIAL_PREFIX}77@{process_space()}-a", True, 0, False),
        (f"{PARTIAL_PREFIX}77@{'0' * 8}-a", False, 0, False),  # of another computer, whose processes nobody here sees
        (f"{PARTIAL_PREFIX}77@{'0' * 8}-a", False, STALE_AFTER_S + 60, True),
        (f"{PARTIAL_PREFIX}77", False, 0, False),
        (f"{PARTIAL_PREFIX}{'9' * 30}-a", False, 0, False),
    ],
)
def test_a_half_written_file_is_left_over_where_nobody_writes_it_any_more(tmp_path, name, is_alive, age_s, expected):
    path = tmp_path / name
    path.touch()
    then = time.time() - age_s
    os.utime(path, (then, then))
    assert is_left_over(path, lambda _: is_alive) is expected


def test_a_half_written_file_that_has_gone_is_complete(tmp_path):
    assert not is_left_over(tmp_path / f"{PARTIAL_PREFIX}77-a", lambda _: True)


def test_what_fails_halfway_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")

    def write_half() -> None:
        with atomic_path(path) as partial:
            assert partial.suffix == ".txt"
            partial.write_text("ne")
            raise RuntimeError("interrupted")

    with pytest.raises(RuntimeError, match="interrupted"):
        write_half()
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.txt"]
    assert path.read_text() == "old"


@pytest.mark.parametrize("is_durable", [False, True])
def test_a_complete_file_takes_the_place_of_the_old_one(tmp_path, is_durable):
    (tmp_path / "new").write_text("new")
    (tmp_path / "a").write_text("old")
    replace_file(tmp_path / "new", tmp_path / "a", is_durable=is_durable)
    assert [(entry.name, entry.read_text()) for entry in tmp_path.iterdir()] == [("a", "new")]


@pytest.mark.parametrize(
    ("number", "hint"), [(errno.ENOSPC, "Free some space"), (errno.EDQUOT, "Free some space"), (errno.EACCES, "rights")]
)
def test_what_the_disk_says_leads_to_what_to_do(tmp_path, number, hint):
    error = disk_error(OSError(number, os.strerror(number)), what="The clip", path=tmp_path)
    assert error.message == f"The clip could not be written ({os.strerror(number)})."
    assert hint in error.hint
