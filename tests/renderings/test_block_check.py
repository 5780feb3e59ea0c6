import pytest

from map3d.errors import Corrupt
from map3d.renderings.block_check import check_rendered
from map3d.tiles.tile_store import StoredTile, StoreShape
from map3d.types import BlockId, Layer

LAYERS = (Layer("color", "color", "webp", 80), Layer("id", "id", "png"))
SHAPE = StoreShape(256, 4, LAYERS)
BLOCK = BlockId(1, 1, 0)
GOOD = [StoredTile(layer, *tile, b"x") for tile in ((1, 1, 0), (2, 3, 1), (3, 7, 3)) for layer in (0, 1)]


def test_complete_and_empty_blocks_pass() -> None:
    check_rendered(SHAPE, BLOCK, GOOD, b"seam")
    check_rendered(SHAPE, BLOCK, [], None)


@pytest.mark.parametrize(
    ("tiles", "seam", "says"),
    [
        (GOOD[:-1], b"s", "has layers"),
        (GOOD[2:], b"s", "has no parent"),
        (GOOD[:2] + GOOD[4:], b"s", "has no parent"),
        ([*GOOD, StoredTile(0, 1, 0, 0, b"x"), StoredTile(1, 1, 0, 0, b"x")], b"s", "belongs to another block"),
        ([*GOOD, StoredTile(0, 4, 15, 7, b"")], b"s", "no bytes"),
        (GOOD, None, "no seam"),
        ([], b"s", "a seam"),
    ],
)
def test_inconsistent_block_is_refused(tiles: list[StoredTile], seam: bytes | None, says: str) -> None:
    with pytest.raises(Corrupt, match=says):
        check_rendered(SHAPE, BLOCK, tiles, seam)
