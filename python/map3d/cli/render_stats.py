"""`map3d render --stats`: the time of each stage and the hit rates of the caches."""

from collections.abc import Mapping
from typing import Any, Final

from map3d.cli.output import print_table

STAGES: Final = ("visibility", "shade", "light", "reduce", "encode", "seam")
CACHES: Final = ("chunk", "texture")


def summary(stats: Mapping[str, float]) -> dict[str, Any]:
    """Returns the seconds of all subprocesses by stage, and hits, misses and hit rate of each cache; a rate is None when the cache was not used."""
    caches = {}
    for name in CACHES:
        hits, misses = int(stats.get(f"{name}_hits", 0)), int(stats.get(f"{name}_misses", 0))
        caches[name] = {"hits": hits, "misses": misses, "hit_rate": hits / (hits + misses) if hits + misses else None}
    caches["texture"] |= {name: int(stats.get(f"texture_{name}", 0)) for name in ("decoded", "evicted")}
    return {"seconds": {name: float(stats.get(f"{name}_s", 0.0)) for name in STAGES}, "caches": caches}


def print_summary(found: Mapping[str, Any]) -> None:
    """Prints the summary as tables."""
    total = sum(found["seconds"].values())
    print_table(
        ("stage", "seconds", "share"),
        [(name, f"{seconds:.1f}", f"{100 * seconds / total if total else 0:.0f} %") for name, seconds in found["seconds"].items()],
    )
    rows = []
    for name, counts in found["caches"].items():
        rate = None if counts["hit_rate"] is None else f"{100 * counts['hit_rate']:.2f} %"
        rows.append((name, counts["hits"], counts["misses"], rate))
    print_table(("cache", "hits", "misses", "hit rate"), rows)
    textures = found["caches"]["texture"]
    print_table(("images decoded", "texture levels evicted"), [(textures["decoded"], textures["evicted"])])
