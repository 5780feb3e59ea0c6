//! All tests of tracing in one program, which is linked once.

mod beams;
mod cutouts;
mod occupancy;
mod packets;
mod reference;
mod scenes;
mod watertight;
