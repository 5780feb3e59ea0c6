//! The lattice of 2^-12 m on which all chunk vertices lie (spec/scene.md): sums of a chunk's origin and its float32 positions are exact.

use map3d_base::Vec3;

pub const STEPS_PER_M: f64 = 4096.0;
/// Edges longer than this are split at their snapped midpoint, on both sides alike.
pub const MAX_EDGE_M: f64 = 1024.0;
/// Float32 holds lattice points exactly up to this distance from a chunk's origin.
pub const EXACT_REACH_M: f64 = 4096.0;

/// A point in lattice steps.
pub type Point = [i64; 3];

/// Nearest lattice point of local metres, halves rounded up.
pub fn snap(p: Vec3) -> Point {
    p.map(|v| (v * STEPS_PER_M + 0.5).floor() as i64)
}

/// Metres; exact for |coordinate| < 2^40 m.
pub fn metres(p: Point) -> Vec3 {
    p.map(|v| v as f64 / STEPS_PER_M)
}

/// Halfway between two points; the same from both ends.
pub fn midpoint(a: Point, b: Point) -> Point {
    [0, 1, 2].map(|k| (a[k] + b[k]).div_euclid(2))
}

pub fn is_long(a: Point, b: Point) -> bool {
    let limit = (MAX_EDGE_M * STEPS_PER_M) as i128;
    let squared: i128 = (0..3).map(|k| i128::from(a[k] - b[k]).pow(2)).sum();
    squared > limit * limit
}

/// Corners on one line, or in one point.
pub fn has_no_area(t: [Point; 3]) -> bool {
    let edge = |i: usize| [0, 1, 2].map(|k| i128::from(t[i][k] - t[0][k]));
    let (a, b) = (edge(1), edge(2));
    (0..3).all(|k| a[k] * b[(k + 1) % 3] == a[(k + 1) % 3] * b[k])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn midpoint_is_the_same_from_both_ends() {
        let (a, b) = ([-7, 3, 10], [4, -6, 11]);
        assert_eq!(midpoint(a, b), midpoint(b, a));
    }

    #[test]
    fn snapping_rounds_to_the_nearest_step() {
        assert_eq!(snap([0.49 / 4096.0, 0.51 / 4096.0, -0.51 / 4096.0]), [0, 1, -1]);
        assert_eq!(metres(snap([1.5, -2.25, 1e8])), [1.5, -2.25, 1e8]);
    }

    #[test]
    fn collinear_and_repeated_corners_have_no_area() {
        assert!(has_no_area([[0, 0, 0], [1, 2, 3], [2, 4, 6]]));
        assert!(has_no_area([[5, 5, 5], [5, 5, 5], [9, 1, 2]]));
        assert!(!has_no_area([[0, 0, 0], [1, 0, 0], [0, 0, 1]]));
    }

    #[test]
    fn an_edge_of_1024_m_is_not_long() {
        let end = (1024.0 * STEPS_PER_M) as i64;
        assert!(!is_long([0; 3], [end, 0, 0]));
        assert!(is_long([0; 3], [end + 1, 0, 0]));
    }
}
