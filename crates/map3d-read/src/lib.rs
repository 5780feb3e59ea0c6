//! Readers: source documents to batches of triangles.
