"""Work in turn: its order, its errors, and that it may be given after the end."""

from __future__ import annotations

import threading

import pytest

from app.background.in_turn import InTurn
from engine.errors import DiskError
from tests.app.conftest import DEADLINE_S


@pytest.mark.parametrize("is_apart", [True, False])
def test_work_is_done_in_turn_and_errors_are_given_back(is_apart: bool) -> None:
    disk, done = InTurn("a disk", is_apart=is_apart), list[object]()

    def fail() -> None:
        done.append(threading.current_thread() is threading.main_thread())
        raise DiskError("full")

    failed = disk.do(fail, wait_s=0.0)
    last = [disk.do(lambda number=number: done.append(number), wait_s=0.0) for number in range(3)][-1]
    disk.close()
    last.result(DEADLINE_S)
    assert done == [not is_apart, 0, 1, 2]
    with pytest.raises(DiskError, match="full"):
        failed.result()
    assert disk.do(lambda: "later", wait_s=DEADLINE_S).result() == "later"
    disk.close()


def test_work_that_hangs_holds_nobody_up() -> None:
    disk, may_go_on = InTurn("a disk"), threading.Event()
    hanging = disk.do(lambda: may_go_on.wait(DEADLINE_S), wait_s=0.0)
    behind = disk.do(lambda: "behind", wait_s=0.0)
    assert not hanging.done()
    assert not behind.done()
    may_go_on.set()
    assert behind.result(DEADLINE_S) == "behind"
    assert hanging.done()
