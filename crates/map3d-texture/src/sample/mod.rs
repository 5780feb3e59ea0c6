//! Samples a texture over pixels, in linear light (spec/pyramid.md §5).

mod alpha;
mod footprint;
mod plan;
mod sampler;
mod tap;
mod texel_map;
mod uv_map;

pub use alpha::AlphaSampler;
pub use footprint::{Footprint, MAX_TAPS, Tuning, compute_footprint};
pub use plan::{TapPlan, TapPlanCache};
pub use sampler::{Sampler, SurfaceColors};
pub use uv_map::{POSITION_BITS, UvMap};
