//! Labels and the planes through their depths.

use map3d_base::DEPTH_NOTHING;

use super::segments::{Run, is_step_like};
use super::{FRACTION_BITS, MAX_START, Slopes};

/// Labels with fewer pixels have no plane of their own.
const LEAST_PIXELS: i64 = 8;
/// Greatest slope of a label's plane, units per pixel.
const MAX_SLOPE: f64 = 100_000.0;
/// Slopes of another label are used when its plane differs by less than this, in units.
const SLOPE_TOLERANCE: f64 = 0.35;

/// At most one in this number of pixels of a plane is off it.
const OFF_SHARE: i64 = 3;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// No depths.
    Nothing,
    /// Depths are those of a plane; residuals are differences from it.
    Plane(Slopes),
    /// Depths run along a plane; a residual adds to that of the pixel before: the one on the left, or the first of the label's run before.
    Rough(Slopes),
}

/// Pixels that share id and normal; their depths are nothing, of one plane, or similar.
#[derive(Clone, Copy, Debug)]
pub struct Label {
    pub id: u32,
    pub normal: u32,
    pub x: u32,
    pub y: u32,
    /// Depth of the first pixel.
    depth: u32,
    vertical_step: Option<u32>,
    sums: Sums,
    pub shape: Shape,
    /// Depth at the first pixel by the plane, in 2^-14 units.
    pub start: i64,
    /// Number of pixels off the plane.
    off: i64,
    /// For rough labels, the offset of the first pixel of the last run.
    pub offset: u32,
}

/// Sums over pixels: count, positions and depths relative to the first pixel.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    n: i64,
    x: i64,
    y: i64,
    xx: i64,
    xy: i64,
    yy: i64,
    d: i64,
    xd: i64,
    yd: i64,
}

impl Label {
    pub fn new(id: u32, normal: u32, depth: u32, (x, y): (u32, u32)) -> Self {
        let shape = if depth == DEPTH_NOTHING { Shape::Nothing } else { Shape::Rough(Slopes::default()) };
        Self {
            id,
            normal,
            x,
            y,
            depth,
            vertical_step: None,
            sums: Sums::default(),
            shape,
            start: i64::from(depth) << FRACTION_BITS,
            off: 0,
            offset: 0,
        }
    }

    /// Whether a pixel may belong to it, by its id, normal and whether it has a depth.
    pub fn is_like(&self, id: u32, normal: u32, depth: u32) -> bool {
        self.id == id && self.normal == normal && (depth == DEPTH_NOTHING) == (self.shape == Shape::Nothing)
    }

    /// Whether a step from the row above continues its plane; keeps the first one.
    pub fn takes_step(&mut self, step: u32) -> bool {
        let is_like = self.shape == Shape::Nothing || is_step_like(step, self.vertical_step);
        if is_like && self.vertical_step.is_none() {
            self.vertical_step = Some(step);
        }
        is_like
    }

    /// Adds a run with its depths.
    pub fn add(&mut self, run: &Run, depths: &[u32]) {
        if self.shape == Shape::Nothing {
            return;
        }
        let (mut d, mut kd) = (0, 0);
        for (depth, k) in depths.iter().zip(0..) {
            let above = i64::from(depth.wrapping_sub(self.depth) as i32);
            d += above;
            kd += above * k;
        }
        let n = depths.len() as i64;
        let (x, y) = (i64::from(run.start) - i64::from(self.x), i64::from(run.row) - i64::from(self.y));
        let k = n * (n - 1) / 2;
        let kk = (n - 1) * n * (2 * n - 1) / 6;
        let s = &mut self.sums;
        s.n += n;
        s.x += x * n + k;
        s.y += y * n;
        s.xx += x * x * n + 2 * x * k + kk;
        s.xy += y * (x * n + k);
        s.yy += y * y * n;
        s.d += d;
        s.xd += x * d + kd;
        s.yd += y * d;
    }

    /// Fits a plane; `shared` are slopes to take when they fit as well.
    pub fn fit(&mut self, shared: Option<Slopes>) {
        if self.shape == Shape::Nothing || self.sums.n < LEAST_PIXELS {
            return;
        }
        let m = self.sums.moments();
        let Some(own) = m.slopes() else { return };
        let slopes = shared.filter(|other| m.difference(own, *other) < SLOPE_TOLERANCE).unwrap_or(own);
        let one = f64::from(1 << FRACTION_BITS);
        let level = (m.d + 0.5) * one - m.x * f64::from(slopes.right) - m.y * f64::from(slopes.down);
        let start = (i64::from(self.depth) << FRACTION_BITS) + level.round() as i64;
        if (0..MAX_START).contains(&start) {
            self.shape = Shape::Plane(slopes);
            self.start = start;
        }
    }

    /// Compares a run of a plane; counts the pixels off it.
    pub fn compare(&mut self, run: &mut Run, depths: &[u32]) {
        let Shape::Plane(slopes) = self.shape else { return };
        let off: u32 = self.offsets(slopes, run, depths).map(|offset| u32::from(offset != 0)).sum();
        run.has_residuals = off > 0;
        self.off += i64::from(off);
    }

    /// Returns the differences between the depths of a run and those of the plane.
    pub fn offsets<'d>(&self, slopes: Slopes, run: &Run, depths: &'d [u32]) -> impl Iterator<Item = u32> + use<'d> {
        let right = i64::from(slopes.right) as u64;
        let mut plane = self.at(slopes, run) as u64;
        // The 32 bits that are kept are the same for both kinds of shift; vectors have only the unsigned one.
        depths.iter().map(move |depth| {
            let offset = depth.wrapping_sub((plane >> FRACTION_BITS) as u32);
            plane = plane.wrapping_add(right);
            offset
        })
    }

    /// Turns a plane that more than a third of the pixels are off into a rough one, with slopes in whole units, which repeat more.
    pub fn settle(&mut self) {
        if let Shape::Plane(slopes) = self.shape
            && self.off * OFF_SHARE > self.sums.n
        {
            self.shape = Shape::Rough(Slopes { right: whole(slopes.right), down: whole(slopes.down) });
            self.start = i64::from(self.depth) << FRACTION_BITS;
        }
    }

    /// The plane's depth at the first pixel of a run, in 2^-14 units.
    fn at(&self, slopes: Slopes, run: &Run) -> i64 {
        self.start
            + i64::from(slopes.right) * (i64::from(run.start) - i64::from(self.x))
            + i64::from(slopes.down) * (i64::from(run.row) - i64::from(self.y))
    }
}

/// Rounds to whole units.
fn whole(slope: i32) -> i32 {
    (slope + (1 << (FRACTION_BITS - 1))) & -(1 << FRACTION_BITS)
}

/// Means and central moments.
struct Moments {
    n: f64,
    x: f64,
    y: f64,
    d: f64,
    xx: f64,
    xy: f64,
    yy: f64,
    xd: f64,
    yd: f64,
}

impl Sums {
    fn moments(&self) -> Moments {
        let n = self.n as f64;
        let [x, y, d] = [self.x, self.y, self.d].map(|sum| sum as f64 / n);
        let central = |sum: i64, a: f64, b: f64| sum as f64 - n * a * b;
        let (xx, xy, yy) = (central(self.xx, x, x), central(self.xy, x, y), central(self.yy, y, y));
        Moments { n, x, y, d, xx, xy, yy, xd: central(self.xd, x, d), yd: central(self.yd, y, d) }
    }
}

impl Moments {
    /// The least-squares plane; along one axis only if the pixels lie on a line; `None` if it is too steep.
    fn slopes(&self) -> Option<Slopes> {
        let det = self.xx * self.yy - self.xy * self.xy;
        let (right, down) = if det > 1e-9 * (self.xx * self.yy).max(1.0) {
            ((self.xd * self.yy - self.yd * self.xy) / det, (self.yd * self.xx - self.xd * self.xy) / det)
        } else if self.xx >= self.yy {
            (self.xd / self.xx, 0.0)
        } else {
            (0.0, self.yd / self.yy)
        };
        let fixed = |slope: f64| (slope * f64::from(1 << FRACTION_BITS)).round() as i32;
        (right.abs() <= MAX_SLOPE && down.abs() <= MAX_SLOPE).then(|| Slopes { right: fixed(right), down: fixed(down) })
    }

    /// How far two planes differ two standard deviations from the centre, in units.
    fn difference(&self, a: Slopes, b: Slopes) -> f64 {
        let reach = |variance: f64| 2.0 * (variance / self.n).max(0.0).sqrt();
        let units = |a: i32, b: i32| f64::from(a.wrapping_sub(b)).abs() / f64::from(1 << FRACTION_BITS);
        units(a.right, b.right) * reach(self.xx) + units(a.down, b.down) * reach(self.yy)
    }
}
