//! Images of any view of a scene (spec/cameras.md): orthographic and in perspective, from any position in any direction.

mod image;
mod pick;
mod renderer;
mod request;
mod times;

pub use image::{ViewImage, ViewPixels};
pub use pick::{HitSelection, RayHit};
pub use request::{Region, ViewRequest};
pub use times::ViewTimes;
