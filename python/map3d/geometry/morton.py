"""Morton numbers, which order the tiles of a level so that neighbours are near each other."""


def morton(x: int, y: int) -> int:
    """Interleaves the bits of x and y, with x in the even bits."""
    return _spread(x) | _spread(y) << 1


def from_morton(number: int) -> tuple[int, int]:
    """Returns (x, y)."""
    return _gather(number), _gather(number >> 1)


def _spread(value: int) -> int:
    spread = 0
    for bit in range(value.bit_length()):
        spread |= (value >> bit & 1) << (2 * bit)
    return spread


def _gather(value: int) -> int:
    gathered = 0
    for bit in range((value.bit_length() + 1) // 2):
        gathered |= (value >> (2 * bit) & 1) << bit
    return gathered
