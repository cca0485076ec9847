"""Children start, talk, answer, fail and end as they should, whatever they do; pipes never hold up anybody."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from engine.children.kind import ChildFailed
from engine.children.process import ChildProcess, run_child
from engine.errors import CaptureError, EngineError, PreparationError
from tests.engine.children.children import AT_ONCE, STUBBORN, TIDY, WIDE, Ask

DEADLINE_S = 300.0
ROOT = Path(__file__).resolve().parents[3]


def state_of(pid: int) -> str:
    """Letter of a process's state, such as T for halted; Z for one that has ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return "Z"


def is_alive(pid: int) -> bool:
    """Whether a process runs; one that has ended and that nobody has collected does not."""
    return state_of(pid) != "Z"


def wait_for(is_there, what: str) -> None:
    until_s = time.monotonic() + DEADLINE_S
    while not is_there():
        assert time.monotonic() < until_s, f"no {what}"
        time.sleep(0.01)


def first_event(child: ChildProcess) -> str:
    events: list[str] = []
    wait_for(lambda: events.extend(child.poll()) or events or child.is_over, "event")
    assert events
    return events[0]


def test_what_is_asked_comes_back_also_where_it_is_large() -> None:
    assert run_child(AT_ONCE, Ask("echo", payload=WIDE)) == WIDE


def test_variables_are_added_to_its_environment_before_it_begins(monkeypatch) -> None:
    monkeypatch.setenv("KEPT", "of the parent")
    for name, expected in (("ADDED", "of the child"), ("KEPT", "of the parent")):
        child = ChildProcess(AT_ONCE, Ask("variable", payload=name), environment={"ADDED": "of the child"})
        wait_for(lambda child=child: child.is_over, "answer")
        assert child.result() == expected
    assert "ADDED" not in os.environ


def test_what_a_child_repeats_is_reported_once() -> None:
    said: list[str] = []
    assert run_child(AT_ONCE, Ask("flood"), report=said.append) == WIDE
    assert said == [WIDE]


def test_a_child_that_says_much_is_not_held_up_by_one_who_does_not_listen() -> None:
    child = ChildProcess(AT_ONCE, Ask("flood"))
    wait_for(lambda: child.is_over, "end")
    assert child.result() == WIDE
    assert len(child.poll(7)) == 7
    assert child.poll() == [WIDE] * 13
    child.end()


def test_a_child_that_does_not_listen_holds_up_nobody(tmp_path) -> None:
    child = ChildProcess(AT_ONCE, Ask("listen", tmp_path / "listen"))
    assert first_event(child) == "deaf"
    for _ in range(20):
        child.send(WIDE)
    child.send("enough")
    (tmp_path / "listen").touch()
    wait_for(lambda: child.is_over, "end")
    assert child.result() == str(20 * len(WIDE))
    child.end()


@pytest.mark.parametrize(
    ("how", "reason", "is_final"),
    [
        ("fault", r"The child ended with code 1 \(ZeroDivisionError: one of a kind\)", True),
        ("leave", r"The child ended with code 7$", True),
        ("die", "The child was ended by signal 9, perhaps because memory ran out", False),
        ("lie", "The child sent an unreadable message", True),
        ("unknown", r"The child ended with code 1 \(KeyError: 'unknown'\)", True),
    ],
)
def test_a_child_without_an_answer_is_a_reason(how, reason, is_final) -> None:
    with pytest.raises(ChildFailed, match=reason) as caught:
        run_child(AT_ONCE, Ask(how))
    assert caught.value.is_final == is_final


@pytest.mark.slow
def test_what_a_child_refuses_is_raised_as_it_raised_it(tmp_path) -> None:
    with pytest.raises(CaptureError) as caught:
        run_child(AT_ONCE, Ask("refuse", tmp_path))
    error = caught.value
    assert (error.message, error.hint, error.path) == ("Nothing can be seen.", "Open a window.", tmp_path)
    (problem,) = error.problems
    assert isinstance(problem, PreparationError)
    assert str(problem) == f"It is dark. Light it. - {tmp_path}"
    with pytest.raises(EngineError, match="not enough memory"):
        run_child(AT_ONCE, Ask("memory"))


def test_one_that_cannot_be_started_is_a_reason(monkeypatch) -> None:
    monkeypatch.setattr(sys, "executable", "/nowhere/python")
    with pytest.raises(ChildFailed, match="The child could not be started"):
        run_child(AT_ONCE, Ask("echo"))


def test_one_that_stands_still_is_ended() -> None:
    with pytest.raises(ChildFailed, match="The child did not respond for 0 s"):
        run_child(AT_ONCE, Ask("sleep"), stall_s=0.5)


@pytest.mark.slow
def test_one_that_works_and_says_nothing_does_not_stand_still() -> None:
    child = ChildProcess(AT_ONCE, Ask("spin"))
    assert first_event(child) == "working"
    for _ in range(2):
        child.still_s = 1e9
        wait_for(lambda: child.still_s == 0.0, "sign of life")
    child.end()


@pytest.mark.parametrize("kind", [AT_ONCE, STUBBORN])
def test_whoever_gives_up_leaves_no_process(kind) -> None:
    pids: list[int] = []

    def alive() -> None:
        if pids:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_child(kind, Ask("sleep"), report=lambda said: pids.append(int(said)), alive=alive)
    assert not is_alive(pids[0])


@pytest.mark.slow
def test_one_that_tidies_up_has_time_for_it(tmp_path) -> None:
    child = ChildProcess(TIDY, Ask("tidy up", tmp_path / "tidy"))
    pid = int(first_event(child))
    child.end(DEADLINE_S)
    assert (tmp_path / "tidy").read_text() == "tidy"
    assert not is_alive(pid)
    child = ChildProcess(TIDY, Ask("tidy up", tmp_path / "never"))
    child.end(DEADLINE_S)  # it is being loaded: there is nothing to tidy up
    assert not (tmp_path / "never").exists()


TERMINAL = """
import signal, sys
from pathlib import Path
from engine.children.process import ChildProcess
from tests.engine.children.children import TIDY, Ask

# whatever started the tests in the background made its children ignore Ctrl+C; a terminal does not
signal.signal(signal.SIGINT, signal.default_int_handler)
child = ChildProcess(TIDY, Ask("tidy up", Path(sys.argv[1])))
print(child.pid, flush=True)
try:
    while not child.poll():
        child.wait(0.1)
    print("ready", flush=True)
    while True:
        child.wait(3600.0)
except KeyboardInterrupt:
    child.end(300.0)
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="processes have no groups there")
def test_in_a_terminal_ctrl_z_halts_both_and_ctrl_c_is_for_the_parent_to_understand(tmp_path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    pipe, script = subprocess.PIPE, [sys.executable, "-c", TERMINAL, str(tmp_path / "tidy")]
    with subprocess.Popen(script, env=environment, stdout=pipe, stderr=pipe, text=True, process_group=0) as parent:
        assert parent.stdout is not None
        assert parent.stderr is not None
        both = (parent.pid, int(parent.stdout.readline()))
        assert parent.stdout.readline() == "ready\n"
        os.killpg(parent.pid, signal.SIGTSTP)
        wait_for(lambda: [state_of(pid) for pid in both] == ["T", "T"], "halt")
        os.killpg(parent.pid, signal.SIGCONT)
        wait_for(lambda: "T" not in [state_of(pid) for pid in both], "continuation")
        os.killpg(parent.pid, signal.SIGINT)
        assert parent.wait(DEADLINE_S) == 0
        assert parent.stderr.read() == ""
    assert (tmp_path / "tidy").read_text() == "tidy"


def test_the_folder_of_a_child_that_has_answered_is_its_parents(tmp_path) -> None:
    folder = tmp_path / "scratch"
    folder.mkdir()
    child = ChildProcess(AT_ONCE, Ask("linger", payload="done"), folder=folder)
    wait_for(lambda: child.is_over, "answer")
    pid = child.pid
    assert pid is not None
    child.ask_to_end()
    wait_for(lambda: not is_alive(pid), "end of the child")
    assert child.result() == "done"
    assert folder.exists()


PARENT = """
import sys
from pathlib import Path
from engine.children.process import ChildProcess
from tests.engine.children.children import AT_ONCE, TIDY, WIDE, Ask

kind, how, wants_event = {"AT_ONCE": AT_ONCE, "TIDY": TIDY}[sys.argv[1]], sys.argv[2], sys.argv[3] == "late"
folder = Path(sys.argv[4])
child = ChildProcess(kind, Ask(how, folder.parent / "tidy", WIDE), folder=folder)
print(child.pid, flush=True)
while wants_event and not child.poll():
    child.wait(0.1)
print("ready", flush=True)
if sys.argv[5] == "killed":
    sys.stdin.read()
"""


@pytest.mark.parametrize("end", ["ends", "killed"])
@pytest.mark.parametrize("when", ["early", "late"])
@pytest.mark.parametrize(("kind", "how"), [("AT_ONCE", "sleep"), ("TIDY", "tidy up")])
def test_a_child_ends_with_its_parent_and_neither_says_a_word(tmp_path, kind, how, when, end) -> None:
    folder = tmp_path / "scratch"
    folder.mkdir()
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT, kind, how, when, str(folder), end],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    with parent:
        assert parent.stdout is not None
        assert parent.stderr is not None
        child = int(parent.stdout.readline())
        assert parent.stdout.readline() == "ready\n"
        if end == "killed":
            parent.send_signal(signal.SIGKILL)
        assert parent.wait(DEADLINE_S) == (-9 if end == "killed" else 0)
        assert parent.stderr.read() == ""
    wait_for(lambda: not is_alive(child), "end of the child")
    if (kind, when) == ("TIDY", "late"):
        assert (tmp_path / "tidy").exists()
    elif kind == "AT_ONCE":
        assert not folder.exists()
