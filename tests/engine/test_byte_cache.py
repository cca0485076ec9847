"""ByteCache counts what it holds, keeps what was used last, and never throws away the newest value."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from engine.byte_cache import ByteCache


@given(
    max_bytes=st.integers(0, 60),
    puts=st.lists(st.tuples(st.integers(0, 5), st.integers(1, 30)), max_size=40),
)
def test_bytes_are_counted_and_bounded(max_bytes: int, puts: list[tuple[int, int]]) -> None:
    cache: ByteCache[int, int] = ByteCache(max_bytes)
    for key, n_bytes in puts:
        cache.put(key, n_bytes, n_bytes)
        assert cache.get(key) == n_bytes, "the newest stays"
        kept = [size for k in range(6) if (size := cache.get(k)) is not None]
        assert cache.n_bytes == sum(kept) <= max(max_bytes, n_bytes)
        assert len(cache) == len(kept)


def test_what_was_used_longest_ago_goes_first() -> None:
    cache: ByteCache[str, str] = ByteCache(2)
    cache.put("a", "A", 1)
    cache.put("b", "B", 1)
    assert cache.get("a") == "A"
    cache.put("c", "C", 1)
    assert (cache.get("a"), cache.get("b"), cache.get("c")) == ("A", None, "C")


def test_values_are_forgotten_by_key() -> None:
    cache: ByteCache[int, str] = ByteCache(100)
    for key in range(5):
        cache.put(key, str(key), 10)
    cache.drop(lambda key: key % 2 == 0)
    assert [key for key in range(5) if cache.get(key) is not None] == [1, 3]
    assert cache.n_bytes == 20
    cache.clear()
    assert (len(cache), cache.n_bytes) == (0, 0)


def test_where_it_is_known_what_is_wanted_last_that_goes_first() -> None:
    cache: ByteCache[int, str] = ByteCache(3)
    cache.distance = lambda frame: abs(frame - 10)
    for frame in (10, 14, 9, 11):
        cache.put(frame, str(frame), 1)
    assert sorted(cache.keys()) == [9, 10, 11]
    cache.put(30, "30", 1)
    assert 30 in cache, "the newest stays, wherever it is"
    cache.put(12, "12", 1)
    assert sorted(cache.keys()) == [10, 11, 12]


def test_the_revision_tells_whether_other_keys_are_held() -> None:
    cache: ByteCache[int, str] = ByteCache(100)
    cache.put(1, "1", 10)
    before = cache.revision
    cache.get(1)
    assert cache.keys() == [1]
    assert cache.revision == before
    cache.drop(lambda key: key == 2)
    assert cache.revision == before
    cache.drop(lambda key: key == 1)
    assert cache.revision != before
