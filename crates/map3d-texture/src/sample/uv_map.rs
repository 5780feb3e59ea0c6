//! Texture coordinates over the pixels of a surface.

/// Positions are given in 2^-POSITION_BITS pixel.
pub const POSITION_BITS: u32 = 8;

/// Affine texture coordinates (u right, v up, whole images): value at the origin, change per pixel to the right, change per pixel down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UvMap {
    pub u: [f64; 3],
    pub v: [f64; 3],
}

impl UvMap {
    /// Returns texels of level 0 (right, down) per pixel to the right and per pixel down.
    pub fn jacobian(&self, width: u32, height: u32) -> [[f64; 2]; 2] {
        let (w, h) = (f64::from(width), f64::from(height));
        [[self.u[1] * w, -self.v[1] * h], [self.u[2] * w, -self.v[2] * h]]
    }
}
