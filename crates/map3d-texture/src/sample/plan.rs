//! Prepares footprints for the sampler: tap offsets in fixed point, in batches; a cache returns the plans of known footprints.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};
use std::sync::Arc;

use map3d_base::Isa;

use crate::sample::footprint::{Footprint, Tuning, compute_footprint};
use crate::sample::tap::{BATCH, FULL, TAP_BITS, TAP_POSITION_BITS};

/// Bits that rounding keeps of a Jacobian's largest component.
const KEPT_BITS: i32 = 11;
/// As `KEPT_BITS`, where the Jacobian differs from pixel to pixel.
const ROUGH_BITS: i32 = 6;
/// Plans after which the cache drops those not used since it last did.
const GENERATION: usize = 4096;

/// Up to `BATCH` taps: offsets from the pixel's centre in 2^-TAP_POSITION_BITS texel.
#[derive(Clone, Debug, Default)]
pub(super) struct TapBatch {
    pub x: [i32; BATCH],
    pub y: [i32; BATCH],
    pub count: usize,
}

/// Least (≤ 0) and greatest (≥ 0) offset of taps, right and down, in 2^-TAP_POSITION_BITS texel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TapExtent {
    pub x: [i32; 2],
    pub y: [i32; 2],
}

impl TapExtent {
    /// A single tap at the centre.
    pub const POINT: Self = Self { x: [0; 2], y: [0; 2] };
}

/// Level and taps of a footprint.
#[derive(Clone, Debug)]
pub struct TapPlan {
    pub level: u32,
    pub(super) batches: Vec<TapBatch>,
    pub(super) extent: TapExtent,
    /// Factor from a sum of taps to 16 bits, times 2^40.
    pub(super) scale: u64,
    /// An instruction set of this machine.
    pub(super) isa: Isa,
}

impl TapPlan {
    pub fn new(footprint: &Footprint) -> Self {
        Self::with_isa(footprint, Isa::best())
    }

    /// Uses a given instruction set; all give the same results. Panics for one that this machine does not have.
    pub fn with_isa(footprint: &Footprint, isa: Isa) -> Self {
        assert!(Isa::available().contains(&isa), "{isa:?}: this machine does not have it");
        let unit = f64::from(1u32 << TAP_POSITION_BITS);
        // MAX_TAPS gaps of about a texel are far within 32 bits.
        let taps: Vec<[i32; 2]> = footprint.taps.iter().map(|t| t.map(|c| (c * unit).round() as i32)).collect();
        let bounds = |k: usize| taps.iter().fold([0, 0], |[lo, hi], t| [t[k].min(lo), t[k].max(hi)]);
        let full = (taps.len() as u64) * (u64::from(FULL) << TAP_BITS);
        Self {
            level: footprint.level,
            extent: TapExtent { x: bounds(0), y: bounds(1) },
            scale: ((65_535u64 << 40) + full / 2) / full,
            batches: taps.chunks(BATCH).map(batch).collect(),
            isa,
        }
    }

    pub fn tap_count(&self) -> usize {
        self.batches.iter().map(|b| b.count).sum()
    }
}

fn batch(taps: &[[i32; 2]]) -> TapBatch {
    let mut out = TapBatch { count: taps.len(), ..TapBatch::default() };
    for (k, [x, y]) in taps.iter().enumerate() {
        (out.x[k], out.y[k]) = (*x, *y);
    }
    out
}

/// The bits that rounding keeps of a Jacobian, their exponent, and the number of levels.
type PlanKey = ([i32; 5], u32);
type Plans = HashMap<PlanKey, Arc<TapPlan>, BuildHasherDefault<PlanHasher>>;

/// Caches plans: the triangles of a wall, and of walls parallel to it, share one. A plan depends on the rounded Jacobian alone, not on earlier calls.
pub struct TapPlanCache {
    isa: Isa,
    kept_bits: i32,
    plans: Plans,
    /// Those of the generation before; one that is asked for moves to `plans`.
    older: Plans,
}

impl TapPlanCache {
    pub fn new(isa: Isa) -> Self {
        Self { isa, kept_bits: KEPT_BITS, plans: Plans::default(), older: Plans::default() }
    }

    /// Rounds Jacobians to a thirty-second of their largest component, for views in perspective: otherwise hardly two pixels would share a plan.
    pub fn rough(isa: Isa) -> Self {
        Self { kept_bits: ROUGH_BITS, ..Self::new(isa) }
    }

    /// Returns the plan of a surface. `jacobian`: texels of level 0 (right, down) per pixel to the right and per pixel down; `levels` of the texture, ≥ 1.
    pub fn plan(&mut self, jacobian: [[f64; 2]; 2], levels: u32) -> Arc<TapPlan> {
        let isa = self.isa;
        let compute = |jacobian| Arc::new(TapPlan::with_isa(&compute_footprint(jacobian, levels, &Tuning::default()), isa));
        let Some((rounded, kept)) = round_jacobian(jacobian, self.kept_bits) else { return compute(jacobian) };
        let key = (kept, levels);
        if let Some(plan) = self.plans.get(&key) {
            return plan.clone();
        }
        let plan = self.older.remove(&key).unwrap_or_else(|| compute(rounded));
        self.insert(key, plan.clone());
        plan
    }

    fn insert(&mut self, key: PlanKey, plan: Arc<TapPlan>) {
        if self.plans.len() >= GENERATION {
            std::mem::swap(&mut self.plans, &mut self.older);
            self.plans.clear();
        }
        self.plans.insert(key, plan);
    }
}

/// Multiplies and rotates the numbers of a key.
#[derive(Default)]
struct PlanHasher(u64);

impl Hasher for PlanHasher {
    fn finish(&self) -> u64 {
        // The table takes the uppermost and the lowest bits.
        self.0 ^ self.0 >> 32
    }

    fn write(&mut self, bytes: &[u8]) {
        bytes.as_chunks().0.iter().for_each(|word| self.write_u32(u32::from_le_bytes(*word)));
    }

    fn write_u32(&mut self, number: u32) {
        self.0 = (self.0.rotate_left(5) ^ u64::from(number)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    }

    fn write_usize(&mut self, _length: usize) {}
}

/// Rounds to some bits of the largest component; the key holds these bits and their exponent. `None` for numbers that are zero, not finite or extreme.
fn round_jacobian(jacobian: [[f64; 2]; 2], kept_bits: i32) -> Option<([[f64; 2]; 2], [i32; 5])> {
    let all = jacobian.as_flattened();
    let most = all.iter().fold(0.0f64, |m, c| m.max(c.abs()));
    if !(all.iter().all(|c| c.is_finite()) && (1e-30..1e30).contains(&most)) {
        return None;
    }
    let exponent = ((most.to_bits() >> 52) as i32) - 1022 - kept_bits;
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
            let (got, _) = round_jacobian(jacobian, KEPT_BITS).expect("finite");
            let most = jacobian.as_flattened().iter().fold(0.0f64, |m, c| m.max(c.abs()));
            assert!((0..4).all(|k| (got.as_flattened()[k] - jacobian.as_flattened()[k]).abs() <= most / 1024.0), "{jacobian:?}: {got:?}");
            assert_eq!(round_jacobian(got, KEPT_BITS).expect("finite").0, got, "rounding twice changes nothing");
        }
        assert!(round_jacobian([[f64::NAN, 0.0], [0.0, 1.0]], KEPT_BITS).is_none() && round_jacobian([[0.0; 2]; 2], KEPT_BITS).is_none());
    }

    #[test]
    fn a_cached_plan_equals_a_fresh_one() {
        let mut plans = TapPlanCache::new(Isa::Scalar);
        for k in 0..10_000 {
            // Every third one was asked for before.
            let t = f64::from(if k % 3 == 2 { k - 7 } else { k }) * 0.37;
            let jacobian = [[1.0 + 3.0 * t.sin(), t.cos()], [-0.4 * t.cos(), 2.0 + t.sin()]];
            let (got, fresh) = (plans.plan(jacobian, 11), TapPlanCache::new(Isa::Scalar).plan(jacobian, 11));
            assert_eq!((got.level, got.tap_count(), got.extent), (fresh.level, fresh.tap_count(), fresh.extent));
        }
    }
}
