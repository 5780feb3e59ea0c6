//! Rendering: beams shaded to G-buffers, reduced and encoded as blocks.
