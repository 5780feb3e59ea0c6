from map3d.web.http.byte_lru import ENTRY_BYTES, ByteLru


def test_the_least_recently_used_entry_is_evicted_first():
    cache = ByteLru(10 * ENTRY_BYTES)
    for key in range(10):
        cache.put(key, key, 0)
    cache.get(0)
    cache.put(10, 10, 0)
    assert (cache.get(0), cache.get(1), cache.get(10)) == (0, None, 10)


def test_the_cache_never_exceeds_its_capacity():
    cache = ByteLru(20_000)
    for key in range(500):
        cache.put(key % 37, key, key * 13 % 1500)
        assert cache.used_bytes <= 20_000
        assert cache.used_bytes == sum(cost for _, cost in cache._entries.values())


def test_too_large_values_are_not_stored():
    cache = ByteLru(80 * ENTRY_BYTES)
    cache.put("small", 1, 0)
    cache.put("large", 2, 10 * ENTRY_BYTES)
    assert (cache.get("small"), cache.get("large"), len(cache)) == (1, None, 1)


def test_replacing_an_entry_counts_it_once():
    cache = ByteLru(100_000)
    cache.put("a", 1, 100)
    cache.put("a", 2, 50)
    assert (cache.get("a"), cache.used_bytes) == (2, 50 + ENTRY_BYTES)
    cache.discard("a")
    cache.discard("a")
    assert (len(cache), cache.used_bytes) == (0, 0)
