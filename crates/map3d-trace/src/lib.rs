//! Tracing: beams (all samples of a square of pixels at once) and rays through the chunks of a scene. The rules are those of spec/pyramid.md §4.
//!
//! `BeamTracer::trace` fills a `VisBuf`: which surface each of the 16 samples of each pixel meets. `Rays` answers single rays by the same rules.

pub mod beam;
pub mod bundle;
pub mod cutout;
mod lanes;
pub mod occupancy;
pub mod plane;
pub mod ray;
pub mod surface;
pub mod visbuf;

pub use beam::BeamTracer;
pub use bundle::{Bundles, Nearest, Openness, Patch, RAYS, Shadow, Surroundings};
pub use cutout::{Cutout, CutoutSample, Opaque, Stencil};
pub use map3d_base::Isa;
pub use occupancy::{block_key, occupied};
pub use plane::DepthPlane;
pub use ray::{Hit, Ray, Rays};
pub use surface::{Affine, Surface};
pub use visbuf::{Pixel, SUBTILE_PX, VisBuf};
