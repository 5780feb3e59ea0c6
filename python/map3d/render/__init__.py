"""From a scene to tiles: building it, planning blocks, rendering one block, checking the whole."""
