"""Routes of a rendering: tiles, manifest, attribute documents and pictures."""
