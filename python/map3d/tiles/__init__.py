"""Tile and block names, the tile store, occupancy, the manifest and previews. Independent of scenes."""
