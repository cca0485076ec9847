"""Iterators at the same time: every item once, errors and early ends."""

import threading
from collections.abc import Iterator

import pytest

from engine.metrics.clips.side_by_side import side_by_side


@pytest.mark.parametrize("n_threads", [1, 2, 7])
def test_every_item_comes_once_and_in_the_order_of_its_iterator(n_threads):
    found = list(side_by_side([iter([(i, j) for j in range(i)]) for i in range(6)], n_threads=n_threads))
    assert sorted(found) == [(i, j) for i in range(6) for j in range(i)]
    for i in range(6):
        assert [j for k, j in found if k == i] == list(range(i))
    assert list(side_by_side([], n_threads=n_threads)) == []


def test_as_many_at_a_time_as_wanted_each_thread_prepared_once():
    both_run = threading.Barrier(2, timeout=300)  # passes only when two wait at it at once
    prepared: list[int] = []

    def waits() -> Iterator[int]:
        both_run.wait()
        yield 1

    found = side_by_side([waits(), waits()], n_threads=2, prepare=lambda: prepared.append(threading.get_ident()))
    assert list(found) == [1, 1]
    assert len(prepared) == len(set(prepared)) == 2


def test_an_error_ends_all_of_it():
    def endless() -> Iterator[int]:
        while True:
            yield 0

    def fails() -> Iterator[int]:
        yield 1
        raise OSError("gone")

    with pytest.raises(OSError, match="gone"):
        for _ in side_by_side([endless(), fails()], n_threads=2):
            pass
    with pytest.raises(OSError, match="first"):
        list(side_by_side([iter([1])], n_threads=1, prepare=_refuses))


def _refuses() -> None:
    raise OSError("first")


def test_stopping_early_leaves_no_thread_behind():
    taken: list[int] = []

    def counts() -> Iterator[int]:
        for i in range(1_000_000):
            taken.append(i)
            yield i

    n_before = threading.active_count()
    found = side_by_side([counts(), counts()], n_threads=2)
    next(found)
    found.close()  # type: ignore[attr-defined] - a generator
    assert threading.active_count() == n_before
    assert len(taken) < 100  # at most those that wait to be taken
