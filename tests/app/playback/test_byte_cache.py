"""ByteCache: what was used last stays, as far as there is room."""

from __future__ import annotations

from app.playback.byte_cache import ByteCache


def test_what_was_not_used_for_longest_goes_first():
    cache: ByteCache[str, int] = ByteCache(10)
    cache.put("a", 1, 4)
    cache.put("b", 2, 4)
    assert cache.get("a") == 1  # used again, so b is older now
    cache.put("c", 3, 4)
    assert (cache.get("a"), cache.get("b"), cache.get("c")) == (1, None, 3)
    assert (len(cache), cache.n_bytes) == (2, 8)


def test_a_value_put_again_takes_the_place_of_the_first():
    cache: ByteCache[str, int] = ByteCache(10)
    cache.put("a", 1, 4)
    cache.put("a", 2, 6)
    assert (cache.get("a"), len(cache), cache.n_bytes) == (2, 1, 6)


def test_the_newest_stays_however_large_it_is():
    cache: ByteCache[str, int] = ByteCache(10)
    cache.put("a", 1, 4)
    cache.put("b", 2, 1000)
    assert (cache.get("a"), cache.get("b"), cache.n_bytes) == (None, 2, 1000)


def test_dropping_and_clearing_free_bytes():
    cache: ByteCache[tuple[int, str], int] = ByteCache(100)
    for key in ((1, "a"), (1, "b"), (2, "a")):
        cache.put(key, 0, 7)
    cache.drop(lambda key: key[0] == 1)
    assert (len(cache), cache.n_bytes) == (1, 7)
    cache.clear()
    assert (len(cache), cache.n_bytes) == (0, 0)
