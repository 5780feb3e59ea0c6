//! Scenes: assets to chunks with a BVH, memory-mapped.
