"""The lock of a project folder: one owner at a time, whatever lies in its place and however the last one ended."""

from __future__ import annotations

import errno
import json
import os
import platform
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from app.document.project_settings import ProjectSettings
from app.project import lock as module
from app.project.lock import ProcessLock, boot_id, is_process_alive, machine_id, process_start, read_owner
from app.project.opening.project_access import create_project, open_project
from engine.errors import DiskError, ProjectError

ROOT = Path(__file__).resolve().parents[3]

HOLDER = """
import sys, time
from pathlib import Path
from app.project.lock import ProcessLock
lock = ProcessLock(Path(sys.argv[1]))
lock.acquire()
print("held", flush=True)
time.sleep(600)
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "lock"


@pytest.fixture
def dead_pid() -> int:
    """A process id that was in use and is not any more."""
    child = subprocess.Popen([sys.executable, "-c", "pass"])
    child.wait()
    assert not is_process_alive(child.pid)
    return child.pid


@pytest.fixture
def holder(path):
    """Another process that holds the lock."""
    child = subprocess.Popen([sys.executable, "-c", HOLDER, str(path)], stdout=subprocess.PIPE, text=True)
    assert child.stdout is not None
    assert child.stdout.readline() == "held\n"
    yield child
    child.kill()
    child.communicate()


def take(path: Path) -> None:
    lock = ProcessLock(path)
    lock.acquire()
    assert lock.is_held
    owner = read_owner(path)
    assert owner is not None
    assert owner.pid == os.getpid()
    lock.release()
    assert not path.exists()


def test_the_owner_is_named_with_machine_process_and_time(path, holder):
    owner = read_owner(path)
    assert owner is not None
    assert (owner.pid, owner.host) == (holder.pid, platform.node())
    assert owner.start == process_start(holder.pid)
    with pytest.raises(ProjectError) as caught:
        ProcessLock(path).acquire()
    assert f"Another process ({holder.pid}) has this project open for writing since {owner.since}." in str(caught.value)


@pytest.mark.parametrize("content", [None, b"", b"{", b"\xff\xfe", b'{"pid": 1}', b'{"pid": 1e400}'])
def test_nobody_takes_the_lock_of_a_living_process_whatever_its_file_says(path, holder, content):
    path.unlink()
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ProjectError, match="open for writing"):
        ProcessLock(path).acquire()
    assert path.exists() == (content is not None)


def test_the_lock_of_a_killed_process_is_taken_over(path, holder):
    holder.send_signal(signal.SIGKILL)
    holder.wait()
    assert path.exists()
    take(path)


def test_a_second_lock_of_the_same_process_is_refused_and_a_later_one_is_not(path):
    first, second = ProcessLock(path), ProcessLock(path)
    first.acquire()
    with pytest.raises(ProjectError, match="This program has this project open"):
        second.acquire()
    assert not second.is_held
    second.release()
    assert path.exists()
    first.release()
    take(path)
    assert list(path.parent.iterdir()) == []


@pytest.mark.parametrize(
    "content",
    [
        *(b"", b"{", b"[]", b"null", b"\xff\xfe\x00", b"[" * 4000, b"{" * 100_000, b'{"pid": "7"}', b'{"pid": true}'),
        *(b'{"pid": 100000000000000000000}', b'{"pid": 1e400}', b'{"pid": -1}', b'{"pid": 0}', b'{"start": "1"}'),
        *(b'{"pid": NaN}', b'{"pid": 1' + b"0" * 5000 + b"}", b'{"pid": 1, "start": 5}', b'{"pid": OWN, "start": "1"}'),
        *(b'{"pid": DEAD}', b'{"pid": DEAD, "start": "5"}', b'{"pid": DEAD, "host": "HERE", "machine": "MACHINE"}'),
    ],
)
def test_what_no_living_process_has_written_is_taken_over(path, content, dead_pid):
    for name, value in (
        ("OWN", os.getpid()),
        ("DEAD", dead_pid),
        ("HERE", platform.node()),
        ("MACHINE", machine_id()),
    ):
        content = content.replace(name.encode(), str(value).encode())
    path.write_bytes(content)
    take(path)


def test_a_link_is_replaced_and_never_followed(path, tmp_path):
    for target in ("missing", "precious"):
        (tmp_path / "precious").write_text("precious")
        for name in (path, path.with_name(".lock")):
            name.symlink_to(tmp_path / target)
        take(path)
        assert (tmp_path / "precious").read_text() == "precious"
        assert not (tmp_path / "missing").exists()


@pytest.mark.parametrize("name", ["lock", ".lock"])
@pytest.mark.parametrize(("make", "said"), [(os.mkdir, "is a folder"), (os.mkfifo, "is not a regular file")])
def test_what_is_not_a_file_is_named(tmp_path, name, make, said):
    make(tmp_path / name)
    with pytest.raises(ProjectError, match=said) as caught:
        ProcessLock(tmp_path / "lock").acquire()
    assert caught.value.path == tmp_path / name


def test_a_lock_of_the_version_before_is_respected_while_its_process_lives(path, holder):
    path.write_text(json.dumps({"pid": holder.pid, "start": process_start(holder.pid)}))
    path.with_name(".lock").unlink()  # that version knew none
    with pytest.raises(ProjectError, match=f"Another process \\({holder.pid}\\)"):
        ProcessLock(path).acquire()
    holder.kill()
    holder.wait()
    take(path)


def test_the_version_before_can_read_whose_lock_it_is(path):
    lock = ProcessLock(path)
    lock.acquire()
    content = json.loads(path.read_text())
    assert (content["pid"], content["start"]) == (os.getpid(), process_start(os.getpid()))
    lock.release()


@pytest.mark.parametrize("machine", ["somewhere", ""])
def test_a_lock_of_another_machine_is_never_taken_over(path, dead_pid, machine):
    text = json.dumps({"pid": dead_pid, "start": "5", "host": "render\x1b[31m7", "machine": machine, "boot": "other"})
    path.write_text(text)
    with pytest.raises(ProjectError) as caught:
        ProcessLock(path).acquire()
    assert f"A program on the computer render\\x1b[31m7 (process {dead_pid}) has this project open" in str(caught.value)
    assert 'remove the file "lock"' in caught.value.hint
    assert path.read_text() == text
    path.unlink()
    take(path)


def test_a_machine_that_was_started_again_finds_its_own_lock(path, dead_pid):
    owner = {"pid": dead_pid, "start": "5", "host": platform.node(), "machine": machine_id(), "boot": "before"}
    path.write_text(json.dumps(owner))
    take(path)


def test_a_container_of_the_same_machine_is_not_another_machine(path, dead_pid):
    if not boot_id():
        pytest.skip("this system does not say which kernel runs")
    path.write_text(json.dumps({"pid": dead_pid, "start": "5", "host": "3f2a", "machine": "", "boot": boot_id()}))
    take(path)


def test_releasing_leaves_somebody_elses_lock(path):
    lock = ProcessLock(path)
    lock.acquire()
    path.write_text('{"pid": 1}')
    lock.release()
    assert path.read_text() == '{"pid": 1}'


def test_a_file_system_without_locks_still_has_one_owner(path, monkeypatch):
    from filelock import FileLock

    def refuse(self: FileLock) -> None:
        raise OSError(module.errno.ENOLCK, "No locks available")

    monkeypatch.setattr(FileLock, "_acquire", refuse)
    first = ProcessLock(path)
    first.acquire()
    with pytest.raises(ProjectError, match="open for writing"):
        ProcessLock(path).acquire()
    first.release()
    take(path)


def test_a_folder_made_ready_by_two_is_the_project_of_one(tmp_path, monkeypatch):
    settings = ProjectSettings("capture", "0123")
    acquire = ProcessLock.acquire

    def late(self: ProcessLock) -> None:
        monkeypatch.setattr(ProcessLock, "acquire", acquire)
        create_project(tmp_path / "p", settings).close()  # the other one is quicker
        acquire(self)

    monkeypatch.setattr(ProcessLock, "acquire", late)
    with pytest.raises(ProjectError, match="a project already"):
        create_project(tmp_path / "p", ProjectSettings("another", "4567"))
    project = open_project(tmp_path / "p")
    assert project.settings == settings
    project.close()


@pytest.mark.slow
def test_many_processes_and_kills_never_make_two_owners():
    command = [sys.executable, "-m", "tests.faults.lock_stress", "--attempts", "600", "--seed", "1"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False, cwd=ROOT)
    assert run.stderr == ""
    figures = re.findall(r"(\d+) (takes|owners killed|over left-over|double owners|untyped)", run.stdout)
    found = {name: int(n) for n, name in figures}
    assert (found["double owners"], found["untyped"]) == (0, 0)
    assert min(found["takes"], found["over left-over"], found["owners killed"]) > 0
    assert run.returncode == 0


@pytest.mark.parametrize(
    ("number", "kind", "hint"),
    [(errno.ENOSPC, DiskError, "Free some space"), (errno.EACCES, ProjectError, "Choose a folder you may write to")],
)
def test_a_full_disk_is_told_from_a_folder_that_may_not_be_written(path, monkeypatch, number, kind, hint):
    def refuse(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(module, "atomic_path", refuse)
    with pytest.raises(ProjectError) as caught:
        ProcessLock(path).acquire()
    assert type(caught.value) is kind
    assert hint in str(caught.value)
