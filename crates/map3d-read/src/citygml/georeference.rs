//! Where an image lies in the world: pixel centres to coordinates and back.

use map3d_base::Vec3;

/// x = a·column + b·row + c, y = d·column + e·row + f, for the centres of pixels counted from the upper left one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Georeference {
    pub a: f64,
    pub b: f64,
    pub c: f64,
    pub d: f64,
    pub e: f64,
    pub f: f64,
}

impl Georeference {
    /// From `referencePoint` (centre of the upper left pixel) and `orientation` (2 × 2, row by row).
    pub fn new(reference: Vec3, [a, b, d, e]: [f64; 4]) -> Option<Self> {
        Self { a, b, c: reference[0], d, e, f: reference[1] }.checked()
    }

    /// From a world file: six lines a, d, b, e, c, f.
    pub fn from_world_file(text: &str) -> Option<Self> {
        let values: Vec<f64> = text.split_whitespace().map_while(|w| w.replace(',', ".").parse().ok()).collect();
        let [a, d, b, e, c, f] = *values.first_chunk()?;
        Self { a, b, c, d, e, f }.checked()
    }

    fn checked(self) -> Option<Self> {
        let finite = [self.a, self.b, self.c, self.d, self.e, self.f].iter().all(|v| v.is_finite());
        (finite && self.determinant() != 0.0).then_some(self)
    }

    fn determinant(&self) -> f64 {
        self.a * self.e - self.b * self.d
    }

    /// Texture coordinates (u right, v up, (0, 0) the lower left corner) of a point, in an image of this size.
    pub fn uv(&self, point: Vec3, width_px: u32, height_px: u32) -> [f64; 2] {
        let (x, y) = (point[0] - self.c, point[1] - self.f);
        let column = (self.e * x - self.b * y) / self.determinant();
        let row = (self.a * y - self.d * x) / self.determinant();
        [(column + 0.5) / f64::from(width_px), 1.0 - (row + 0.5) / f64::from(height_px)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_of_an_image_have_the_coordinates_of_its_corners() {
        let by_point = Georeference::new([100.5, 203.5, 0.0], [1.0, 0.0, 0.0, -1.0]).expect("sound");
        assert_eq!(Georeference::from_world_file("1.0\n0\n0\n-1,0\n100.5\n203.5\n"), Some(by_point));
        for (point, uv) in [([100.0, 200.0, 9.0], [0.0, 0.0]), ([108.0, 204.0, 9.0], [1.0, 1.0]), ([104.0, 204.0, 0.0], [0.5, 1.0])] {
            assert_eq!(by_point.uv(point, 8, 4), uv);
        }
        assert_eq!(Georeference::new([0.0; 3], [1.0, 2.0, 2.0, 4.0]), None, "no inverse");
        assert_eq!(Georeference::from_world_file("1 0 0 -1 5"), None);
    }
}
