"""Maps on threads keep the order, and spans cover every row once."""

import threading

import pytest

from engine import parallel
from engine.parallel import map_ordered, row_spans


def test_results_keep_the_order_of_the_items(monkeypatch):
    monkeypatch.setattr(parallel, "n_cores", lambda: 2)
    is_second_done = threading.Event()

    def function(item: int) -> int:
        if item == 0:
            assert is_second_done.wait(300)  # the first one ends last
        else:
            is_second_done.set()
        return item * item

    assert map_ordered(function, range(5)) == [0, 1, 4, 9, 16]


def test_what_fails_on_a_thread_reaches_the_caller(monkeypatch):
    monkeypatch.setattr(parallel, "n_cores", lambda: 2)
    with pytest.raises(ZeroDivisionError):
        map_ordered(lambda item: 1 // item, [1, 0, 2])


def test_one_core_needs_no_thread(monkeypatch):
    monkeypatch.setattr(parallel, "n_cores", lambda: 1)
    here = threading.get_ident()
    assert map_ordered(lambda _: threading.get_ident(), range(3)) == [here] * 3


@pytest.mark.parametrize(("n_rows", "n_spans"), [(0, None), (1, None), (7, 3), (3, 7), (1000, None)])
def test_spans_follow_each_other_and_cover_every_row(n_rows, n_spans):
    spans = row_spans(n_rows, n_spans)
    assert [row for start, stop in spans for row in range(start, stop)] == list(range(n_rows))
    lengths = [stop - start for start, stop in spans]
    assert max(lengths) - min(lengths) <= 1


@pytest.mark.parametrize(("value", "expected"), [("1", 1), ("3", 3), ("99", 4), ("0", 1), ("many", 4), ("", 4)])
def test_a_process_uses_no_more_cores_than_it_was_told(monkeypatch, value, expected):
    monkeypatch.setattr(parallel.os, "sched_getaffinity", lambda _: {0, 1, 2, 3}, raising=False)
    monkeypatch.setenv(parallel.CORES_VARIABLE, value)
    assert parallel.n_cores() == expected


def test_children_are_told_as_well(monkeypatch):
    monkeypatch.setattr(parallel.os, "environ", environment := {})
    parallel.share_cores(2)
    assert environment == {"CLIPGSTREAM_CORES": "2", "NUMBA_NUM_THREADS": "2"}
