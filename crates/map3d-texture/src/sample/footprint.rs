//! Chooses the level and the taps that integrate a texture over a pixel's square.
//!
//! In parallel projection the square maps to the same parallelogram of texels for all pixels of a surface. The exact filter is the box over it,
//! applied to the bilinearly interpolated texture. Taps at a level of the mip pyramid blur by that level's texels. The layout of the taps is
//! therefore shorter than the parallelogram, so that the second moments of the sum (layout + level's box + bilinear tent) come near those of the
//! exact filter:
//!
//! ```text
//! A Aᵀ / 12 = J Jᵀ / 12 − k (4^level − 1)/4 · I        J: texels of level 0 per pixel, A: the layout's axes, k: compensation
//! ```
//!
//! k = 1 makes them equal and keeps contrast, but the result depends more on where a texel falls in a pixel. k = ⅓ is the exact box over the
//! level's texels, which loses 10–15 % of the gradient energy at two texels per pixel. The default is between them.

/// Longest row of taps; a longer one takes a coarser level instead.
pub const MAX_TAPS: usize = 16;

/// Parameters of the choice of taps; the default was tuned against the exact integral.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuning {
    /// Least length of the footprint's short axis in texels of the level.
    pub texels_per_axis: f64,
    /// k above: the share of the level's blur for which the layout compensates.
    pub compensation: f64,
    /// Largest gap between taps in texels of the level.
    pub max_gap: f64,
    /// A layout shorter than this, in texels of the level, takes one tap.
    pub point_below: f64,
}

impl Default for Tuning {
    fn default() -> Self {
        Self { texels_per_axis: 1.95, compensation: 0.8, max_gap: 1.05, point_below: 0.4 }
    }
}

/// A level, and tap offsets from a pixel's centre in texels of that level.
#[derive(Clone, Debug, PartialEq)]
pub struct Footprint {
    pub level: u32,
    pub taps: Vec<[f64; 2]>,
}

/// Returns the footprint of a pixel. `jacobian`: texels of level 0 (right, down) per pixel to the right and per pixel down; `levels` of the texture, ≥ 1.
pub fn compute_footprint(jacobian: [[f64; 2]; 2], levels: u32, tuning: &Tuning) -> Footprint {
    let [a, b] = jacobian;
    if !jacobian.as_flattened().iter().all(|c| c.is_finite()) {
        return Footprint { level: levels - 1, taps: vec![[0.0; 2]] };
    }
    // The finest level whose texels the short axis still spans.
    let gram = [[dot(a, a), dot(a, b)], [dot(a, b), dot(b, b)]];
    let eigen = Eigen::of_symmetric(gram);
    let short = eigen.small.sqrt() * (1.0 + 1e-9);
    let mut level = (1..levels).rev().find(|l| short >= tuning.texels_per_axis * f64::from(1u32 << l)).unwrap_or(0);
    // Coarser while a row of taps would be too long.
    loop {
        let axes = layout_axes(jacobian, &eigen, level, tuning.compensation);
        let counts = axes.map(|axis| tap_count(length(axis), tuning));
        if counts.iter().all(|n| *n <= MAX_TAPS) || level + 1 >= levels {
            return Footprint { level, taps: tap_grid(axes, counts.map(|n| n.min(MAX_TAPS))) };
        }
        level += 1;
    }
}

/// Returns 12 × the second moment, in texels of level 0, that a level's own texels add.
fn blur(level: u32) -> f64 {
    3.0 * (4f64.powi(level as i32) - 1.0)
}

/// Returns the layout's axes in texels of the level: along the pixel's axes, or along the footprint's own axes when that takes fewer taps.
fn layout_axes([a, b]: [[f64; 2]; 2], eigen: &Eigen, level: u32, compensation: f64) -> [[f64; 2]; 2] {
    // Both principal axes of the footprint, shortened by the level's blur.
    let root = |value: f64| (1.0 - compensation * blur(level) / value).max(0.0).sqrt();
    let (major, minor) = (root(eigen.large), root(eigen.small));
    let texels = 1.0 / f64::from(1u32 << level);
    let image = |t: [f64; 2]| [texels * (a[0] * t[0] + b[0] * t[1]), texels * (a[1] * t[0] + b[1] * t[1])];
    // A step along the pixel's axes, shortened likewise.
    let e = eigen.direction;
    let f = [-e[1], e[0]];
    let shortened = |x: f64, y: f64| {
        let (p, q) = (major * (e[0] * x + e[1] * y), minor * (f[0] * x + f[1] * y));
        [p * e[0] + q * f[0], p * e[1] + q * f[1]]
    };
    let of_pixel = [image(shortened(1.0, 0.0)), image(shortened(0.0, 1.0))];
    let own = [image([major * e[0], major * e[1]]), image([minor * f[0], minor * f[1]])];
    let area = |axes: [[f64; 2]; 2]| length(axes[0]).max(1.0) * length(axes[1]).max(1.0);
    if area(of_pixel) > 1.5 * area(own) { own } else { of_pixel }
}

fn tap_count(length: f64, tuning: &Tuning) -> usize {
    if length < tuning.point_below {
        return 1;
    }
    let ratio = length / tuning.max_gap;
    ((ratio * ratio + 1.0).sqrt().ceil() as usize).max(2)
}

/// Returns taps at equal distances whose second moment is that of a line as long as the axis.
fn tap_grid(axes: [[f64; 2]; 2], counts: [usize; 2]) -> Vec<[f64; 2]> {
    let offsets = |n: usize| -> Vec<f64> {
        let step = if n > 1 { 1.0 / ((n * n - 1) as f64).sqrt() } else { 0.0 };
        (0..n).map(|i| (i as f64 - (n - 1) as f64 / 2.0) * step).collect()
    };
    let (along, across) = (offsets(counts[0]), offsets(counts[1]));
    across.iter().flat_map(|t| along.iter().map(move |s| [0, 1].map(|c| axes[0][c] * s + axes[1][c] * t))).collect()
}

/// Eigenvalues of a symmetric 2 × 2 matrix, at least 1e-12, and the unit eigenvector of the larger one.
struct Eigen {
    large: f64,
    small: f64,
    direction: [f64; 2],
}

impl Eigen {
    fn of_symmetric([[p, q], [_, r]]: [[f64; 2]; 2]) -> Self {
        let (mean, half) = ((p + r) / 2.0, (p - r) / 2.0);
        let distance = half.hypot(q);
        let direction = match half >= 0.0 {
            true => [half + distance, q],
            false => [q, distance - half],
        };
        let l = length(direction);
        let direction = if l > 1e-9 * mean.max(1e-300) { [direction[0] / l, direction[1] / l] } else { [1.0, 0.0] };
        Self { large: (mean + distance).max(1e-12), small: (mean - distance).max(1e-12), direction }
    }
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn length(a: [f64; 2]) -> f64 {
    a[0].hypot(a[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Second moments of the taps with their level's box and tent, in texels of level 0.
    fn moments(f: &Footprint) -> [f64; 3] {
        let s = f64::from(1u32 << f.level);
        let n = f.taps.len() as f64;
        let sum = |g: &dyn Fn(&[f64; 2]) -> f64| f.taps.iter().map(g).sum::<f64>() / n * s * s;
        let own = (s * s - 1.0) / 12.0 + s * s / 6.0;
        [sum(&|t| t[0] * t[0]) + own, sum(&|t| t[0] * t[1]), sum(&|t| t[1] * t[1]) + own]
    }

    #[test]
    fn second_moments_are_those_of_the_exact_filter() {
        for [a, b] in
            [[[4.0, 0.0], [0.0, 4.0]], [[3.0, 3.0], [-3.0, 3.0]], [[9.0, 1.0], [2.0, 4.0]], [[5.0, 0.0], [4.0, 6.0]], [[1.1, 0.0], [0.0, 9.0]]]
        {
            let f = compute_footprint([a, b], 12, &Tuning { compensation: 1.0, point_below: 0.0, ..Tuning::default() });
            let got = moments(&f);
            let exact =
                [(a[0] * a[0] + b[0] * b[0]) / 12.0 + 1.0 / 6.0, (a[0] * a[1] + b[0] * b[1]) / 12.0, (a[1] * a[1] + b[1] * b[1]) / 12.0 + 1.0 / 6.0];
            assert!((0..3).all(|k| (got[k] - exact[k]).abs() < 1e-9 * exact[0].max(exact[2])), "{a:?} {b:?}: {got:?} {exact:?}");
        }
    }

    #[test]
    fn magnified_textures_take_one_tap_of_level_0() {
        let f = compute_footprint([[0.1, 0.02], [0.0, 0.2]], 11, &Tuning::default());
        assert_eq!((f.level, f.taps), (0, vec![[0.0, 0.0]]));
    }

    #[test]
    fn absurd_jacobians_stay_within_the_pyramid() {
        for j in
            [[[1e9, 0.0], [0.0, 1e9]], [[f64::NAN, 0.0], [0.0, 1.0]], [[f64::INFINITY, 0.0], [0.0, 1.0]], [[0.0; 2]; 2], [[1e6, 1.0], [1e6, 1.0]]]
        {
            let f = compute_footprint(j, 11, &Tuning::default());
            assert!(f.level < 11 && (1..=MAX_TAPS * MAX_TAPS).contains(&f.taps.len()));
            assert!(f.taps.iter().flatten().all(|c| c.is_finite()));
        }
    }
}
