"""Every kind of child process: what it declares can be imported and decoded, it draws nothing, and it ends as all do.

How children talk, fail and end is shown of made-up ones in tests/engine/children.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from engine.children.kind import ChildFailed, find
from engine.children.process import ChildProcess
from tests.engine.children.test_process import DEADLINE_S, is_alive, wait_for

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
DECLARED = re.compile(r'(?:\bplace=|arrays_kind\(\s*)"([\w.]+:\w+)"')
PLACES = sorted(
    place
    for package in ("app", "engine")
    for path in (ROOT / package).rglob("*.py")
    for place in DECLARED.findall(path.read_text("utf-8"))
)
NO_JOB = ["x" * (1 << 20)] * 10
"""Much more than a pipe holds, and nothing that any kind is asked."""
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT)}

PROBE = """
import sys
import msgspec
import engine.training.clip_training  # what the builder of trainings imports late
from app.training.process import BUILD
from engine.children.kind import find

find(BUILD)
for place in sys.argv[1:]:
    kind = find(place)
    assert kind.place == place
    assert callable(find(kind.work))
    for crossing in (kind.job, kind.event, kind.result, kind.command):
        crossing = find(crossing) if isinstance(crossing, str) else crossing
        msgspec.msgpack.Decoder(crossing, dec_hook=lambda kind, value: value)
print(*{name.partition(".")[0] for name in sys.modules})
"""


def started(job: object) -> list[ChildProcess]:
    """A child of every kind."""
    return [ChildProcess(find(place), job) for place in PLACES]


def test_what_is_declared_is_there_and_draws_nothing() -> None:
    assert {"TRAINING", "EXPORTING", "MENDING", "CALIBRATING", "MATCHING"} <= {place.split(":")[1] for place in PLACES}
    done = subprocess.run(
        [sys.executable, "-c", PROBE, *PLACES],
        env=ENVIRONMENT,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    loaded = set(done.stdout.split())
    assert "torch" in loaded  # so that the list is of the right process
    assert loaded.isdisjoint({"pyglet", "moderngl", "imgui_bundle", "ui", "glcontext"})


def test_what_is_no_job_ends_a_child_with_a_reason_and_holds_up_nobody() -> None:
    for child in started(NO_JOB):
        wait_for(lambda child=child: child.is_over, f"end of {child.kind.place}")
        with pytest.raises(ChildFailed, match=r"ended with code 1 \(msgspec.ValidationError") as caught:
            child.result()
        assert caught.value.is_final
        assert child.poll() == []
        child.end()


def test_a_child_killed_before_its_first_word_has_a_reason() -> None:
    for place in PLACES:
        child = ChildProcess(find(place), NO_JOB)
        child.kill()  # at once: while others are waited for it would have read its job
        wait_for(lambda child=child: child.is_over, f"end of {child.kind.place}")
        with pytest.raises(ChildFailed, match="was ended by signal 9"):
            child.result()


def test_a_child_that_is_given_up_is_gone() -> None:
    children = started(NO_JOB)
    for child in children:
        child.end()
        assert child.pid is not None
        assert not is_alive(child.pid), child.kind.place


PARENT = """
import logging, os, signal, sys
from engine.children.kind import find
from engine.children.process import ChildProcess

logging.disable()  # it may notice that a child has failed before it ends itself
children = [ChildProcess(kind, None) for kind in map(find, sys.argv[2:])]
print(*[child.pid for child in children], flush=True)
if sys.argv[1] == "killed":
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.parametrize("end", ["ends", "killed"])
def test_no_child_outlives_its_parent_or_says_a_word_after_it(end) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", PARENT, end, *PLACES],
        env=ENVIRONMENT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as parent:
        said, errors = parent.communicate(timeout=DEADLINE_S)
    assert parent.returncode == (-9 if end == "killed" else 0)
    assert errors == ""
    pids = [int(pid) for pid in said.split()]
    assert len(pids) == len(PLACES)
    wait_for(lambda: not any(map(is_alive, pids)), "end of the children")
