//! Where the time of views goes.

/// Seconds of the threads' CPU time by stage.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ViewTimes {
    /// Finding the surfaces, with opening chunks.
    pub visibility_s: f64,
    /// Computing colours and normals, with reading and decoding textures.
    pub shade_s: f64,
    /// Shadows and ambient occlusion.
    pub light_s: f64,
    /// Converting to the bytes of the image.
    pub convert_s: f64,
}

impl ViewTimes {
    pub fn add(&mut self, other: &Self) {
        self.visibility_s += other.visibility_s;
        self.shade_s += other.shade_s;
        self.light_s += other.light_s;
        self.convert_s += other.convert_s;
    }
}
