"""Random numbers that depend on what they are for, never on the order of work."""

import zlib

import numpy as np


def rng(seed: int, *key: int | str) -> np.random.Generator:
    """The generator of one thing, such as `rng(7, "building", 41)`."""
    words = [zlib.crc32(part.encode()) if isinstance(part, str) else part & 0xFFFFFFFF for part in key]
    return np.random.default_rng(np.random.SeedSequence([seed & 0xFFFFFFFF, *words]))
