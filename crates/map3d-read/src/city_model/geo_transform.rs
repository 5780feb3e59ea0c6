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

    /// Computes the position of a pixel: its column and row, 0 at the centre of the first.
    pub fn to_world(self, [column, row]: [f64; 2]) -> [f64; 2] {
        [self.a * column + self.b * row + self.c, self.d * column + self.e * row + self.f]
    }

    /// Fits the transformation to pixels with known positions by least squares. Returns also the greatest error at any of them, in pixels; `None` if
    /// the positions are not finite or lie on a line.
    pub fn fit(pixels: &[[f64; 2]], positions: &[[f64; 2]]) -> Option<(Self, f64)> {
        let count = pixels.len() as f64;
        let mean = |points: &[[f64; 2]]| [0, 1].map(|k| points.iter().map(|p| p[k]).sum::<f64>() / count);
        let (pixel_mean, mean) = (mean(pixels), mean(positions));
        let from = |p: &[f64; 2], origin: [f64; 2]| [p[0] - origin[0], p[1] - origin[1]];
        let sum = |f: &dyn Fn([f64; 2], [f64; 2]) -> f64| -> f64 {
            pixels.iter().zip(positions).map(|(pixel, position)| f(from(pixel, pixel_mean), from(position, mean))).sum()
        };
        let (cc, cr, rr) = (sum(&|p, _| p[0] * p[0]), sum(&|p, _| p[0] * p[1]), sum(&|p, _| p[1] * p[1]));
        let determinant = cc * rr - cr * cr;
        let solve = |k: usize| {
            let (cx, rx) = (sum(&|p, w| p[0] * w[k]), sum(&|p, w| p[1] * w[k]));
            [(cx * rr - rx * cr) / determinant, (rx * cc - cx * cr) / determinant]
        };
        let ([a, b], [d, e]) = (solve(0), solve(1));
        let [c, f] = [mean[0] - a * pixel_mean[0] - b * pixel_mean[1], mean[1] - d * pixel_mean[0] - e * pixel_mean[1]];
        let fitted = Self { a, b, c, d, e, f }.validate()?;
        let error = |(pixel, position): (&[f64; 2], &[f64; 2])| {
            let [column, row] = fitted.to_pixel(*position);
            (column - pixel[0]).hypot(row - pixel[1])
        };
        let worst = pixels.iter().zip(positions).map(error).fold(0.0, f64::max);
        worst.is_finite().then_some((fitted, worst))
    }

    fn to_pixel(self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (x, y) = (x - self.c, y - self.f);
        [(self.e * x - self.b * y) / self.compute_determinant(), (self.a * y - self.d * x) / self.compute_determinant()]
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
        let [column, row] = self.to_pixel([point[0], point[1]]);
        [(column + 0.5) / f64::from(width_px), 1.0 - (row + 0.5) / f64::from(height_px)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fit_finds_the_transformation_and_its_error() {
        let exact = GeoTransform { a: 0.5, b: 0.1, c: 691_000.0, d: 0.2, e: -0.5, f: 5_336_000.0 };
        let pixels: Vec<[f64; 2]> = (0..25).map(|k| [f64::from(k % 5) * 100.0, f64::from(k / 5) * 50.0]).collect();
        let mut positions: Vec<[f64; 2]> = pixels.iter().map(|p| exact.to_world(*p)).collect();
        let (found, error) = GeoTransform::fit(&pixels, &positions).expect("a plane");
        assert!(error < 1e-5, "{error}");
        for (got, expected) in
            [(found.a, exact.a), (found.b, exact.b), (found.c, exact.c), (found.d, exact.d), (found.e, exact.e), (found.f, exact.f)]
        {
            assert!((got - expected).abs() < 1e-6 * expected.abs().max(1.0), "{got} {expected}");
        }
        positions[12] = exact.to_world([pixels[12][0] + 2.0, pixels[12][1]]);
        let (_, error) = GeoTransform::fit(&pixels, &positions).expect("a plane");
        assert!((1.8..2.0).contains(&error), "{error}: the others keep the fit");
        positions[12][0] = f64::NAN;
        assert_eq!(GeoTransform::fit(&pixels, &positions), None);
        assert_eq!(GeoTransform::fit(&pixels[..5], &positions[..5]), None, "on a line");
    }

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
