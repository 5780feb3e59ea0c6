"""Random generators whose numbers depend on their purpose, not on the order of the work."""

import zlib

import numpy as np


def rng(seed: int, *key: int | str) -> np.random.Generator:
    """Returns the generator for a purpose, such as `rng(7, "building", 41)`."""
    words = [zlib.crc32(part.encode()) if isinstance(part, str) else part & 0xFFFFFFFF for part in key]
    return np.random.default_rng(np.random.SeedSequence([seed & 0xFFFFFFFF, *words]))
