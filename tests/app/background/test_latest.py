"""LatestWorker: the newest request wins, failures are reported once, closing ends the thread."""

import threading

from app.background.latest import LatestWorker

WAIT_S = 300.0


def test_requests_that_did_not_start_are_dropped_for_the_newest():
    started, go_on = threading.Event(), threading.Event()
    computed = []

    def compute(value: int) -> int:
        computed.append(value)
        started.set()
        assert go_on.wait(WAIT_S)
        return value * 10

    worker = LatestWorker("test", compute)
    worker.request(1)
    assert started.wait(WAIT_S)
    for value in (2, 3, 4):
        worker.request(value)
    go_on.set()
    assert worker.wait_idle(WAIT_S)
    assert computed == [1, 4]
    assert worker.newest == (4, 40)
    worker.close()


def test_the_same_request_is_computed_once():
    go_on = threading.Event()
    computed = []

    def compute(value: int) -> int:
        assert go_on.wait(WAIT_S)
        computed.append(value)
        return value

    worker = LatestWorker("test", compute)
    for _ in range(5):
        worker.request(7)
    go_on.set()
    assert worker.wait_idle(WAIT_S)
    assert computed == [7]
    worker.close()


def test_a_failure_is_handed_over_once_and_not_tried_again_at_every_frame():
    tries = []

    def compute(value: int) -> int:
        tries.append(value)
        raise ValueError(f"no {value}")

    worker = LatestWorker("test", compute)
    for _ in range(3):
        worker.request(1)
        assert worker.wait_idle(WAIT_S)
    assert tries == [1]
    found = worker.take_error()
    assert found is not None
    assert (found[0], str(found[1])) == (1, "no 1")
    assert worker.take_error() is None
    worker.request(2)
    assert worker.wait_idle(WAIT_S)
    assert tries == [1, 2]
    worker.close()


def test_preparing_happens_once_on_the_thread():
    threads = []
    worker = LatestWorker("test", lambda value: value, prepare=lambda: threads.append(threading.current_thread()))
    for value in (1, 2):
        worker.request(value)
        assert worker.wait_idle(WAIT_S)
    assert len(threads) == 1
    assert threads[0] is not threading.current_thread()
    worker.close()


def test_after_closing_nothing_is_computed():
    worker = LatestWorker("test", lambda value: value)
    worker.close()
    worker.request(1)
    assert worker.newest is None
    assert not worker.is_busy


def test_what_runs_while_everything_is_forgotten_is_dropped_and_can_be_asked_for_again():
    started, go_on = threading.Event(), threading.Event()
    computed = []

    def compute(value: int) -> int:
        computed.append(value)
        started.set()
        assert go_on.wait(WAIT_S)
        if len(computed) == 1:
            raise ValueError("of what was before")
        return value * 10

    worker = LatestWorker("test", compute)
    worker.request(1)
    assert started.wait(WAIT_S)
    worker.forget()
    worker.request(1)
    go_on.set()
    assert worker.wait_idle(WAIT_S)
    assert worker.take_error() is None
    assert not worker.has_failed(1)
    assert (computed, worker.newest) == ([1, 1], (1, 10))
    worker.close()


def _held_worker() -> tuple[LatestWorker[str, str], list[str], threading.Event, threading.Semaphore]:
    """A worker whose every result waits for a turn; what it began, when it began the first, and the turns."""
    began: list[str] = []
    has_begun, turns = threading.Event(), threading.Semaphore(0)

    def compute(value: str) -> str:
        began.append(value)
        has_begun.set()
        assert turns.acquire(timeout=WAIT_S)
        return value.upper()

    return LatestWorker("test", compute), began, has_begun, turns


def _release(turns: threading.Semaphore) -> None:
    for _ in range(20):
        turns.release()


def test_what_is_asked_goes_before_what_is_planned():
    worker, began, has_begun, turns = _held_worker()
    worker.plan(["a", "b", "c"])
    assert has_begun.wait(WAIT_S)
    assert not worker.is_busy, "nobody waits for what is planned"
    worker.request("x")
    _release(turns)
    assert worker.wait_idle(WAIT_S)
    assert began == ["a", "x", "b", "c"]
    assert worker.newest == ("x", "X"), "what was planned is not what was asked for"
    assert worker.n_ahead == 3
    worker.close()


def test_a_newer_plan_takes_the_place_of_the_older_one():
    worker, began, has_begun, turns = _held_worker()
    worker.plan(["a", "b", "c"])
    assert has_begun.wait(WAIT_S)
    worker.plan(["d"])
    _release(turns)
    assert worker.wait_idle(WAIT_S)
    assert began == ["a", "d"]
    worker.close()


def test_planned_work_that_is_asked_for_while_it_runs_becomes_the_newest():
    worker, began, has_begun, turns = _held_worker()
    worker.plan(["a"])
    assert has_begun.wait(WAIT_S)
    worker.request("a")
    assert worker.is_busy
    _release(turns)
    assert worker.wait_idle(WAIT_S)
    assert (began, worker.newest, worker.n_ahead) == (["a"], ("a", "A"), 0)
    worker.close()


def test_a_planned_failure_is_told_only_when_it_is_asked_for():
    tries = []

    def compute(value: int) -> int:
        tries.append(value)
        raise ValueError(f"no {value}")

    worker = LatestWorker("test", compute)
    for _ in range(3):
        worker.plan([1])
        assert worker.wait_idle(WAIT_S)
    assert tries == [1]
    assert worker.take_error() is None
    assert not worker.has_failed(1)
    worker.request(1)
    assert worker.wait_idle(WAIT_S)
    assert tries == [1, 1]
    assert worker.has_failed(1)
    worker.close()


def test_every_lane_keeps_its_newest_request_and_the_active_one_comes_first():
    worker, began, has_begun, turns = _held_worker()
    worker.active_lane = 2
    worker.request("running", lane=0)
    assert has_begun.wait(WAIT_S)
    for lane, value in ((0, "old"), (1, "one"), (2, "two"), (0, "zero")):
        worker.request(value, lane=lane)
    for value in ("two again",):
        turns.release()  # "running" ends, the active lane is next
        while len(began) < 2:
            pass
        worker.request(value, lane=2)
    _release(turns)
    assert worker.wait_idle(WAIT_S)
    assert began == ["running", "two", "zero", "two again", "one"], "others get every second turn"
    worker.close()


def test_forgetting_drops_plans_and_lanes():
    worker, began, has_begun, turns = _held_worker()
    worker.plan(["a", "b"])
    assert has_begun.wait(WAIT_S)
    worker.request("x", lane=1)
    worker.forget()
    _release(turns)
    assert worker.wait_idle(WAIT_S)
    assert (began, worker.newest, worker.n_ahead) == (["a"], None, 0)
    worker.close()
    worker.plan(["c"])
    assert worker.is_idle
