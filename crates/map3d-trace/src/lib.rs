//! Tracing: beams (all samples of a square of pixels at once), ray packets and single rays through the chunks of a scene. The rules are those of
//! spec/pyramid.md §4.
//!
//! `BeamTracer::trace` fills a `VisBuf`, which holds the surface that each of the 16 samples of each pixel shows. `Rays` and `RayPackets` trace rays by the
//! same rules.

pub mod beam;
mod boxes;
pub mod cutout;
mod depth_key;
mod depth_plane;
mod lanes;
pub mod occupancy;
pub mod packet;
mod part;
mod perspective;
mod projection;
pub mod ray;
pub mod surface;

pub use beam::{BeamTracer, CurvedSurface, MIXED, NOTHING, Pixel, SUBTILE_PX, ViewClip, VisBuf};
pub use cutout::{Cutout, CutoutMask, CutoutSample, IgnoreCutouts};
pub use depth_plane::DepthPlane;
pub use map3d_base::Isa;
pub use occupancy::{CPU, block_keys, occupied, occupied_within};
pub use packet::{AmbientOcclusion, ClosestHits, HitMask, PACKET_SIZE, PacketOrigins, RayPackets, SceneRegion};
pub use perspective::PerspectiveMap;
pub use ray::{Hit, HitQuery, Ray, Rays};
pub use surface::{Affine, SurfaceAttributes, texture_at};
