//! A grid over rectangles in plan, from which those near another rectangle are found.

/// Cells along the longer side, at most.
const MAX_CELLS: f64 = 1024.0;

/// A rectangle: x and y of its low and high corner.
pub(super) type Rectangle = [[f64; 2]; 2];

/// Numbers of rectangles by cell.
pub(super) struct PlanIndex {
    lo: [f64; 2],
    hi: [f64; 2],
    cell_m: f64,
    columns: usize,
    rows: usize,
    /// Where the numbers of each cell begin in `numbers`, row by row.
    starts: Vec<u32>,
    numbers: Vec<u32>,
}

impl PlanIndex {
    pub fn new(rectangles: &[Rectangle]) -> Self {
        let mut out =
            Self { lo: [f64::INFINITY; 2], hi: [f64::NEG_INFINITY; 2], cell_m: 1.0, columns: 1, rows: 1, starts: vec![0, 0], numbers: Vec::new() };
        let mut sum = 0.0;
        for [lo, hi] in rectangles {
            for k in 0..2 {
                (out.lo[k], out.hi[k]) = (out.lo[k].min(lo[k]), out.hi[k].max(hi[k]));
            }
            sum += (hi[0] - lo[0]).max(hi[1] - lo[1]);
        }
        if rectangles.is_empty() {
            return out;
        }
        let (count, size) = (rectangles.len() as f64, [0, 1].map(|k| out.hi[k] - out.lo[k]));
        let longer = size[0].max(size[1]);
        out.cell_m = (sum / count).max(longer / MAX_CELLS.min(count.sqrt().ceil() * 2.0)).max(longer / MAX_CELLS).max(1e-6);
        [out.columns, out.rows] = size.map(|s| (s / out.cell_m) as usize + 1);
        let mut counts = vec![0_u32; out.columns * out.rows + 1];
        rectangles.iter().for_each(|r| out.cells(r).for_each(|c| counts[c + 1] += 1));
        (1..counts.len()).for_each(|c| counts[c] += counts[c - 1]);
        let mut next = counts.clone();
        out.numbers = vec![0; counts[counts.len() - 1] as usize];
        for (number, rectangle) in rectangles.iter().enumerate() {
            for c in out.cells(rectangle) {
                out.numbers[next[c] as usize] = number as u32;
                next[c] += 1;
            }
        }
        out.starts = counts;
        out
    }

    /// Passes on the numbers of the rectangles in the cells that a rectangle meets; some more than once.
    pub fn visit(&self, rectangle: &Rectangle, found: &mut dyn FnMut(usize)) {
        if (0..2).any(|k| rectangle[0][k] > self.hi[k] || rectangle[1][k] < self.lo[k]) {
            return;
        }
        for c in self.cells(rectangle) {
            self.numbers[self.starts[c] as usize..self.starts[c + 1] as usize].iter().for_each(|n| found(*n as usize));
        }
    }

    fn cells(&self, [lo, hi]: &Rectangle) -> impl Iterator<Item = usize> + use<> {
        let (columns, last) = (self.columns, [self.columns - 1, self.rows - 1]);
        let at = |v: f64, k: usize| (((v - self.lo[k]) / self.cell_m).max(0.0) as usize).min(last[k]);
        let (x, y) = (at(lo[0], 0)..=at(hi[0], 0), at(lo[1], 1)..=at(hi[1], 1));
        y.flat_map(move |row| x.clone().map(move |column| row * columns + column))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_rectangle_that_meets_another_is_found() {
        let all: Vec<Rectangle> = (0..400)
            .map(|k| {
                let (x, y, size) = (f64::from(k * 37 % 400), f64::from(k * 91 % 300), f64::from(k % 7));
                [[x, y], [x + size, y + 2.0 * size]]
            })
            .collect();
        let index = PlanIndex::new(&all);
        for asked in [[[10.0, 10.0], [60.0, 12.0]], [[-5.0, -5.0], [1000.0, 1000.0]], [[399.0, 299.0], [399.0, 299.0]], [[900.0, 0.0], [901.0, 1.0]]]
        {
            let mut seen = vec![false; all.len()];
            index.visit(&asked, &mut |n| seen[n] = true);
            let meets = |r: &Rectangle| (0..2).all(|k| r[0][k] <= asked[1][k] && r[1][k] >= asked[0][k]);
            assert!(all.iter().zip(&seen).all(|(r, seen)| *seen || !meets(r)));
        }
    }

    #[test]
    fn nothing_is_found_without_rectangles() {
        PlanIndex::new(&[]).visit(&[[0.0; 2], [1.0; 2]], &mut |_| panic!("there is none"));
        let one = PlanIndex::new(&[[[3.0, 3.0], [3.0, 3.0]]]);
        let mut count = 0;
        one.visit(&[[0.0; 2], [5.0; 2]], &mut |_| count += 1);
        assert_eq!(count, 1);
    }
}
