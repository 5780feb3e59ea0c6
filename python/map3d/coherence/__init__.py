"""Compares what the files of a scene say of place, height, unit and objects before anything is built, and decides what contradicts."""
