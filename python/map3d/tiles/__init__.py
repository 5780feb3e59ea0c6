"""Names of tiles and blocks, the tile store, occupancy and the manifest. Knows no scene."""
