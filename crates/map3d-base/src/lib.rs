//! The definitions that all crates share: vectors, view frames, tile names, sample positions, limits, asset files, errors.
//! The pages of `spec/` are their source; this crate does no tracing and knows no image format.

pub mod asset;
pub mod camera;
pub mod error;
pub mod file;
pub mod frame;
pub mod isa;
pub mod kept_space;
pub mod layers;
pub mod limits;
pub mod projection;
pub mod reason;
pub mod samples;
pub mod tile;
pub mod vec3;
pub mod view;

pub use camera::{Camera, CameraKind, Window};
pub use error::{Error, Result};
pub use frame::{Frame, LayerSpec};
pub use isa::Isa;
pub use kept_space::KeptSpace;
pub use layers::{LayerFormat, LayerKind};
pub use projection::{ParallelProjection, PerspectiveProjection, Projection};
pub use reason::Reason;
pub use vec3::{Box3, Vec3};
pub use view::ViewAxes;

/// Depth units per metre: depth is stored in 2^-10 m.
pub const DEPTH_UNITS_PER_M: f64 = 1024.0;
/// Stored depth where there is nothing.
pub const DEPTH_NOTHING: u32 = u32::MAX;
/// Raised only when rendered bytes change.
pub const RENDER_FORMAT: u32 = 7;
/// Rays that leave a surface start this far above it, in metres (spec/pyramid.md §10).
pub const RAY_LIFT_M: f64 = 1.0 / 64.0;
