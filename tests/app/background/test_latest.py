"""LatestWorker: the newest request wins, failures are reported once, closing ends the thread."""

import threading

from app.background.latest import LatestWorker

WAIT_S = 20.0


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
