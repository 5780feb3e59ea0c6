//! Sampling a texture over pixels (spec/pyramid.md §5: in linear light).

mod alpha;
mod footprint;
mod grid;
mod plan;
mod sampler;
mod tap;
mod wide;

pub use alpha::AlphaSampler;
pub use footprint::{Footprint, MAX_TAPS, Tuning, footprint};
pub use plan::{TapPlan, TapPlans};
pub use sampler::{Outside, POSITION_BITS, Sampler, UvMap};
