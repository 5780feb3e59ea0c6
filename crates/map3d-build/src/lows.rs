//! The heights at which triangles begin, in bins: from them follows where the ground of a city is, whatever single objects lie far below it.

use std::collections::BTreeMap;

/// Height of a bin.
const BIN_M: f64 = 8.0;
/// Bins farther from 0 are one.
const LAST_BIN: i64 = 12_500;
/// Content below the rest by more than this, and by more than this many heights of the rest, is no ground of the city if it has at most this share of its
/// triangles.
const GAP_M: f64 = 50.0;
const GAP_HEIGHTS: f64 = 2.0;
const SHARE: f64 = 0.1;

/// Bin → number of triangles, and the lowest of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Lows {
    bins: BTreeMap<i64, (u64, f64)>,
    /// The bin of the last triangle, not yet in `bins`.
    last: Option<(i64, (u64, f64))>,
}

/// Bins without a large gap between them.
struct BinGroup {
    count: u64,
    lo_m: f64,
    hi_m: f64,
}

impl Lows {
    pub fn add(&mut self, lowest_m: f64) {
        let bin = ((lowest_m / BIN_M).floor() as i64).clamp(-LAST_BIN, LAST_BIN);
        match &mut self.last {
            Some((number, (count, lo))) if *number == bin => (*count, *lo) = (*count + 1, lo.min(lowest_m)),
            _ => {
                self.flush();
                self.last = Some((bin, (1, lowest_m)));
            }
        }
    }

    pub fn merge(&mut self, other: &Self) {
        other.rows().into_iter().for_each(|(bin, count, lo)| self.put(bin, count, f64::from_bits(lo)));
    }

    /// Returns (bin, triangles, lowest height as bits), ascending.
    pub fn rows(&self) -> Vec<(i64, u64, u64)> {
        let mut all = Self { bins: self.bins.clone(), last: self.last };
        all.flush();
        all.bins.iter().map(|(bin, (count, lo))| (*bin, *count, lo.to_bits())).collect()
    }

    pub fn from_rows(rows: &[(i64, u64, u64)]) -> Self {
        let mut out = Self::default();
        rows.iter().for_each(|(bin, count, lo)| out.put(*bin, *count, f64::from_bits(*lo)));
        out
    }

    /// Returns the lowest height, without content far below the rest; `None` without triangles.
    pub fn lowest_m(&self) -> Option<f64> {
        let groups = self.groups();
        let least = groups.iter().map(|g| g.count).max()? as f64 * SHARE;
        let city = || groups.iter().filter(|g| g.count as f64 > least);
        let (lo_m, hi_m) = (city().next()?.lo_m, city().next_back()?.hi_m);
        let gap_m = GAP_M.max(GAP_HEIGHTS * (hi_m - lo_m));
        groups.iter().find(|g| lo_m - g.hi_m <= gap_m).map(|g| g.lo_m)
    }

    fn groups(&self) -> Vec<BinGroup> {
        let mut out: Vec<BinGroup> = Vec::new();
        for (bin, count, lo) in self.rows() {
            let (lo_m, hi_m) = (f64::from_bits(lo), (bin + 1) as f64 * BIN_M);
            match out.last_mut() {
                Some(group) if lo_m - group.hi_m <= GAP_M => (group.count, group.hi_m) = (group.count + count, hi_m),
                _ => out.push(BinGroup { count, lo_m, hi_m }),
            }
        }
        out
    }

    fn flush(&mut self) {
        if let Some((bin, (count, lo))) = self.last.take() {
            self.put(bin, count, lo);
        }
    }

    fn put(&mut self, bin: i64, count: u64, lo: f64) {
        let slot = self.bins.entry(bin).or_insert((0, f64::INFINITY));
        *slot = (slot.0 + count, slot.1.min(lo));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lows(heights: &[(f64, u64)]) -> Lows {
        let mut out = Lows::default();
        heights.iter().for_each(|(height, count)| (0..*count).for_each(|_| out.add(*height)));
        out
    }

    #[test]
    fn the_lowest_of_a_city_is_its_lowest() {
        assert_eq!(lows(&[(510.25, 30), (501.5, 2), (540.0, 9)]).lowest_m(), Some(501.5));
        assert_eq!(lows(&[(-3.25, 1)]).lowest_m(), Some(-3.25));
        assert_eq!(Lows::default().lowest_m(), None);
    }

    #[test]
    fn a_house_far_below_the_city_does_not_lower_its_ground() {
        assert_eq!(lows(&[(510.0, 60), (-10.0, 2)]).lowest_m(), Some(510.0));
        assert_eq!(lows(&[(510.0, 60), (-10.0, 2), (1030.0, 2)]).lowest_m(), Some(510.0));
    }

    #[test]
    fn a_valley_below_a_town_on_a_hill_is_ground() {
        assert_eq!(lows(&[(510.0, 60), (570.0, 60), (630.0, 60), (420.0, 3)]).lowest_m(), Some(420.0));
        assert_eq!(lows(&[(510.0, 60), (310.0, 20)]).lowest_m(), Some(310.0));
    }

    #[test]
    fn parts_merge_to_the_whole() {
        let mut half = lows(&[(3.0, 5), (90.0, 1)]);
        half.merge(&lows(&[(2.5, 1), (-900.0, 1)]));
        assert_eq!(half.rows(), lows(&[(3.0, 5), (90.0, 1), (2.5, 1), (-900.0, 1)]).rows());
        assert_eq!(Lows::from_rows(&half.rows()).lowest_m(), half.lowest_m());
    }
}
