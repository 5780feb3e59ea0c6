//! The affine transformation from the pixels of a georeferenced texture to world coordinates.

use map3d_base::Vec3;

/// x = a·column + b·row + c, y = d·column + e·row + f. (0, 0) is the centre of the upper left pixel, as in world files; GDAL's geotransform
/// refers to its corner instead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GeoTransform {
    pub a: f64,
    pub b: f64,
    pub c: f64,
    pub d: f64,
    pub e: f64,
    pub f: f64,
}

impl GeoTransform {
    /// Builds the transformation from `referencePoint` (centre of the upper left pixel) and `orientation` (2 × 2, row-major). Returns `None` if it
    /// has no inverse.
    pub fn new(reference: Vec3, [a, b, d, e]: [f64; 4]) -> Option<Self> {
        Self { a, b, c: reference[0], d, e, f: reference[1] }.validate()
    }

    /// Parses a world file: six lines a, d, b, e, c, f.
    pub fn parse_world_file(text: &str) -> Option<Self> {
        let values: Vec<f64> = text.split_whitespace().map_while(|w| w.replace(',', ".").parse().ok()).collect();
        let [a, d, b, e, c, f] = *values.first_chunk()?;
        Self { a, b, c, d, e, f }.validate()
    }

    fn validate(self) -> Option<Self> {
        let finite = [self.a, self.b, self.c, self.d, self.e, self.f].iter().all(|v| v.is_finite());
        (finite && self.compute_determinant() != 0.0).then_some(self)
    }

    fn compute_determinant(&self) -> f64 {
        self.a * self.e - self.b * self.d
    }

    /// Computes the texture coordinates (u right, v up, origin at the lower left corner) of a world point in an image of this size.
    pub fn compute_uv(&self, point: Vec3, [width_px, height_px]: [u32; 2]) -> [f64; 2] {
        let (x, y) = (point[0] - self.c, point[1] - self.f);
        let column = (self.e * x - self.b * y) / self.compute_determinant();
        let row = (self.a * y - self.d * x) / self.compute_determinant();
        [(column + 0.5) / f64::from(width_px), 1.0 - (row + 0.5) / f64::from(height_px)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn image_corners_map_to_the_corners_of_texture_space() {
        let by_point = GeoTransform::new([100.5, 203.5, 0.0], [1.0, 0.0, 0.0, -1.0]).expect("invertible");
        assert_eq!(GeoTransform::parse_world_file("1.0\n0\n0\n-1,0\n100.5\n203.5\n"), Some(by_point));
        for (point, uv) in [([100.0, 200.0, 9.0], [0.0, 0.0]), ([108.0, 204.0, 9.0], [1.0, 1.0]), ([104.0, 204.0, 0.0], [0.5, 1.0])] {
            assert_eq!(by_point.compute_uv(point, [8, 4]), uv);
        }
        assert_eq!(GeoTransform::new([0.0; 3], [1.0, 2.0, 2.0, 4.0]), None, "no inverse");
        assert_eq!(GeoTransform::parse_world_file("1 0 0 -1 5"), None);
    }
}
