//! Footprints made ready for the sampler: tap offsets in fixed point, in batches; known footprints are looked up.

use std::collections::HashMap;
use std::sync::Arc;

use map3d_base::Isa;

use crate::sample::footprint::{Footprint, Tuning, footprint};
use crate::sample::tap::{BATCH, FULL, PLACE_BITS, TAP_BITS};

/// Bits that a component of a Jacobian keeps, of those of the largest one.
const KEPT_BITS: i32 = 11;
/// Footprints kept at most.
const KNOWN: usize = 4096;

/// Up to `BATCH` taps: offsets from the pixel's place in 2^-PLACE_BITS texel.
#[derive(Clone, Debug, Default)]
pub(super) struct Batch {
    pub x: [i32; BATCH],
    pub y: [i32; BATCH],
    pub count: usize,
}

/// Level and taps of a footprint.
#[derive(Clone, Debug)]
pub struct TapPlan {
    pub level: u32,
    pub(super) batches: Vec<Batch>,
    /// Least (≤ 0) and greatest (≥ 0) offset, right and down.
    pub(super) reach: [[i32; 2]; 2],
    /// From a sum of taps to 16 bits, times 2^40.
    pub(super) scale: u64,
    /// One that this machine has.
    pub(super) isa: Isa,
}

impl TapPlan {
    pub fn new(footprint: &Footprint) -> Self {
        Self::with_isa(footprint, Isa::best())
    }

    /// With an instruction set other than the best; the results are the same. Panics for one that this machine does not have.
    pub fn with_isa(footprint: &Footprint, isa: Isa) -> Self {
        assert!(Isa::available().contains(&isa), "{isa:?}: this machine does not have it");
        let unit = f64::from(1u32 << PLACE_BITS);
        // MAX_TAPS texels of a gap each are far within 32 bits.
        let taps: Vec<[i32; 2]> = footprint.taps.iter().map(|t| t.map(|c| (c * unit).round() as i32)).collect();
        let bounds = |k: usize| taps.iter().fold([0, 0], |[lo, hi], t| [t[k].min(lo), t[k].max(hi)]);
        let full = (taps.len() as u64) * (u64::from(FULL) << TAP_BITS);
        Self {
            level: footprint.level,
            reach: [bounds(0), bounds(1)],
            scale: ((65_535u64 << 40) + full / 2) / full,
            batches: taps.chunks(BATCH).map(batch).collect(),
            isa,
        }
    }

    pub fn tap_count(&self) -> usize {
        self.batches.iter().map(|b| b.count).sum()
    }
}

fn batch(taps: &[[i32; 2]]) -> Batch {
    let mut out = Batch { count: taps.len(), ..Batch::default() };
    for (k, [x, y]) in taps.iter().enumerate() {
        (out.x[k], out.y[k]) = (*x, *y);
    }
    out
}

/// Plans of the footprints that were met: the triangles of a wall, and its neighbours' walls, share one. A plan depends on the rounded Jacobian
/// alone, never on what was met before.
pub struct TapPlans {
    isa: Isa,
    known: HashMap<([i32; 5], u32), Arc<TapPlan>>,
}

impl TapPlans {
    pub fn new(isa: Isa) -> Self {
        Self { isa, known: HashMap::new() }
    }

    /// `jacobian`: texels of level 0 (right, down) per pixel to the right, and per pixel down. `levels` of the texture, ≥ 1.
    pub fn of(&mut self, jacobian: [[f64; 2]; 2], levels: u32) -> Arc<TapPlan> {
        let isa = self.isa;
        let make = |jacobian| Arc::new(TapPlan::with_isa(&footprint(jacobian, levels, &Tuning::default()), isa));
        let Some((rounded, key)) = rounded(jacobian) else { return make(jacobian) };
        if self.known.len() >= KNOWN {
            self.known.clear();
        }
        self.known.entry((key, levels)).or_insert_with(|| make(rounded)).clone()
    }
}

/// To `KEPT_BITS` of the largest component; the key are the kept bits and their exponent. `None` where there is nothing to round.
fn rounded(jacobian: [[f64; 2]; 2]) -> Option<([[f64; 2]; 2], [i32; 5])> {
    let all = jacobian.as_flattened();
    let most = all.iter().fold(0.0f64, |m, c| m.max(c.abs()));
    if !(all.iter().all(|c| c.is_finite()) && (1e-30..1e30).contains(&most)) {
        return None;
    }
    let exponent = ((most.to_bits() >> 52) as i32) - 1022 - KEPT_BITS;
    let unit = 2f64.powi(exponent);
    let kept = jacobian.map(|row| row.map(|c| (c / unit).round()));
    let key = [kept[0][0] as i32, kept[0][1] as i32, kept[1][0] as i32, kept[1][1] as i32, exponent];
    Some((kept.map(|row| row.map(|c| c * unit)), key))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_jacobian_is_rounded_to_a_thousandth_of_its_largest_component() {
        for jacobian in [[[3.7, 0.2], [-0.001, 5.03]], [[1e-9, 2e-9], [0.0, 3e-9]], [[-700.3, 0.0], [4.0, 812.9]]] {
            let (got, _) = rounded(jacobian).expect("finite");
            let most = jacobian.as_flattened().iter().fold(0.0f64, |m, c| m.max(c.abs()));
            assert!((0..4).all(|k| (got.as_flattened()[k] - jacobian.as_flattened()[k]).abs() <= most / 1024.0), "{jacobian:?}: {got:?}");
            assert_eq!(rounded(got).expect("finite").0, got, "what is rounded stays");
        }
        assert!(rounded([[f64::NAN, 0.0], [0.0, 1.0]]).is_none() && rounded([[0.0; 2]; 2]).is_none());
    }

    #[test]
    fn a_known_plan_is_that_of_a_fresh_start() {
        let mut plans = TapPlans::new(Isa::Scalar);
        for k in 0..5000 {
            let t = f64::from(k) * 0.37;
            let jacobian = [[1.0 + 3.0 * t.sin(), t.cos()], [-0.4 * t.cos(), 2.0 + t.sin()]];
            let (got, fresh) = (plans.of(jacobian, 11), TapPlans::new(Isa::Scalar).of(jacobian, 11));
            assert_eq!((got.level, got.tap_count(), got.reach), (fresh.level, fresh.tap_count(), fresh.reach));
        }
    }
}
