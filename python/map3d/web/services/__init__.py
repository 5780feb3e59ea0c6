"""Routes of standards: OGC API – Tiles, WMTS, TileJSON, XYZ and the 3D Portrayal Service."""
