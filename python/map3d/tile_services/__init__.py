"""Tile services: the documents of OGC API – Tiles, WMTS and TileJSON for the colour pyramids of renderings, and pictures put together from tiles."""
