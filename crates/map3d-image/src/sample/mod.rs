//! Sampling a texture over pixels (spec/pyramid.md §5: in linear light).

mod footprint;
mod sampler;
mod tap;

pub use footprint::{Footprint, MAX_TAPS, Tuning, footprint};
pub use sampler::{AlphaSampler, Outside, POSITION_BITS, Sampler, UvMap};
