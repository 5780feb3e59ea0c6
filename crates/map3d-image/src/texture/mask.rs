//! Which texels of an image the UV triangles of a scene touch (spec/scene.md, Texture).

use std::ops::Range;

use map3d_base::asset::Wrap;

/// UV coordinates that miss a texel's border by less than this (in texels) do not touch the neighbour: float32 noise.
const TOUCH_TEXELS: f64 = 1.0 / 512.0;
/// A triangle over more rows than this (before wrapping) uses every texel.
const MAX_ROWS: f64 = 4_194_304.0;

/// One bit a texel, rows top to bottom.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UsageMask {
    width: u32,
    height: u32,
    words: Vec<u64>,
    used: u64,
}

impl UsageMask {
    pub fn empty(width: u32, height: u32) -> Self {
        let texels = width as usize * height as usize;
        Self { width, height, words: vec![0; texels.div_ceil(64)], used: 0 }
    }

    pub fn width(&self) -> u32 {
        self.width
    }

    pub fn height(&self) -> u32 {
        self.height
    }

    pub fn used(&self) -> u64 {
        self.used
    }

    pub fn is_full(&self) -> bool {
        self.used == u64::from(self.width) * u64::from(self.height)
    }

    pub fn get(&self, x: u32, y: u32) -> bool {
        let i = y as usize * self.width as usize + x as usize;
        self.words[i / 64] >> (i % 64) & 1 == 1
    }

    /// Runs of unused texels in a row, as columns.
    pub fn gaps(&self, y: u32) -> Vec<Range<usize>> {
        let start = u64::from(y) * u64::from(self.width);
        let end = start + u64::from(self.width);
        let mut out = Vec::new();
        let mut at = self.run_end(start, true, end);
        while at < end {
            let stop = self.run_end(at, false, end);
            out.push((at - start) as usize..(stop - start) as usize);
            at = self.run_end(stop, true, end);
        }
        out
    }

    /// Marks the texels that a triangle touches. UVs: u right, v up, origin at the lower left corner of the image.
    pub fn add_triangle(&mut self, uv: [[f32; 2]; 3], wrap: Wrap) {
        if self.is_full() || !uv.as_flattened().iter().all(|c| c.is_finite()) {
            return;
        }
        let (w, h) = (f64::from(self.width), f64::from(self.height));
        let p = uv.map(|c| [f64::from(c[0]) * w, (1.0 - f64::from(c[1])) * h]);
        let (lo, hi) = (min3(p.map(|c| c[1])), max3(p.map(|c| c[1])));
        if hi - lo > MAX_ROWS || p.as_flattened().iter().any(|c| c.abs() > 1e12) {
            return self.fill_all();
        }
        let (first, last) = self.within(lo, hi, wrap);
        for row in touched(first, last) {
            let (top, bottom) = self.band(row, lo, hi, wrap);
            let Some((left, right)) = span_in_band(&p, top, bottom) else { continue };
            if let Some(y) = fold(row, self.height, wrap) {
                self.mark_span(y, left, right, wrap);
            }
        }
    }

    /// Rows of a texture that does not repeat are only its own.
    fn within(&self, lo: f64, hi: f64, wrap: Wrap) -> (f64, f64) {
        let h = f64::from(self.height);
        match wrap {
            Wrap::Wrap | Wrap::Mirror => (lo, hi),
            Wrap::Clamp => (lo.clamp(0.0, h - 0.5), hi.clamp(0.5, h)),
            Wrap::Border | Wrap::None => (lo.clamp(-1.0, h + 1.0), hi.clamp(-1.0, h + 1.0)),
        }
    }

    /// What a row stands for: itself; with `Wrap::Clamp` the outer rows stand for all beyond them.
    fn band(&self, row: i64, lo: f64, hi: f64, wrap: Wrap) -> (f64, f64) {
        let clamp = wrap == Wrap::Clamp;
        let top = if clamp && row == 0 { lo.min(0.0) } else { row as f64 };
        let bottom = if clamp && row == i64::from(self.height) - 1 { hi.max(row as f64 + 1.0) } else { row as f64 + 1.0 };
        (top, bottom)
    }

    fn mark_span(&mut self, y: u32, left: f64, right: f64, wrap: Wrap) {
        let repeats = matches!(wrap, Wrap::Wrap | Wrap::Mirror);
        let period = f64::from(self.width) * if wrap == Wrap::Mirror { 2.0 } else { 1.0 };
        if repeats && right - left >= period {
            return self.mark_row(y, 0..i64::from(self.width));
        }
        let w = f64::from(self.width);
        let (left, right) = if repeats { (left, right) } else { (left.clamp(-1.0, w + 1.0), right.clamp(-1.0, w + 1.0)) };
        self.mark_columns(y, touched(left, right), wrap);
    }

    /// Marks the texels that a wrap mode puts at columns of a row, at least one of them and hardly more than a period.
    fn mark_columns(&mut self, y: u32, columns: Range<i64>, wrap: Wrap) {
        let w = i64::from(self.width);
        match wrap {
            Wrap::Clamp => self.mark_row(y, columns.start.clamp(0, w - 1)..(columns.end - 1).clamp(0, w - 1) + 1),
            Wrap::Border | Wrap::None => self.mark_row(y, columns.start.max(0)..columns.end.min(w)),
            Wrap::Wrap => {
                let start = columns.start.rem_euclid(w);
                let end = start + columns.end - columns.start;
                self.mark_row(y, start..end.min(w));
                self.mark_row(y, 0..(end - w).min(w));
            }
            Wrap::Mirror => columns.filter_map(|column| fold(column, w as u32, wrap)).for_each(|x| self.mark(x, y)),
        }
    }

    /// Marks columns of a row; none where the range is empty.
    fn mark_row(&mut self, y: u32, columns: Range<i64>) {
        if columns.start < columns.end {
            let row = u64::from(y) * u64::from(self.width);
            self.set_run(row + columns.start as u64, row + columns.end as u64);
        }
    }

    /// Marks one texel.
    pub fn mark(&mut self, x: u32, y: u32) {
        let i = y as usize * self.width as usize + x as usize;
        let bit = 1u64 << (i % 64);
        self.used += u64::from(self.words[i / 64] & bit == 0);
        self.words[i / 64] |= bit;
    }

    fn fill_all(&mut self) {
        self.set_run(0, u64::from(self.width) * u64::from(self.height));
    }

    /// Run lengths in row order as LEB128, starting with unused.
    pub fn to_runs(&self) -> Vec<u8> {
        let mut out = Vec::new();
        let total = u64::from(self.width) * u64::from(self.height);
        let (mut at, mut value) = (0u64, false);
        while at < total {
            let end = self.run_end(at, value, total);
            leb128(&mut out, end - at);
            (at, value) = (end, !value);
        }
        out
    }

    fn run_end(&self, from: u64, value: bool, total: u64) -> u64 {
        let mut at = from;
        while at < total {
            let word = self.words[(at / 64) as usize] ^ if value { u64::MAX } else { 0 };
            let rest = word >> (at % 64);
            if rest != 0 {
                return (at + u64::from(rest.trailing_zeros())).min(total);
            }
            at = (at / 64 + 1) * 64;
        }
        total
    }

    /// Reads `to_runs` back; `None` when the runs do not add up to the image.
    pub fn from_runs(width: u32, height: u32, runs: &[u8]) -> Option<Self> {
        let mut mask = Self::empty(width, height);
        let total = u64::from(width) * u64::from(height);
        let (mut at, mut value, mut rest) = (0u64, false, runs);
        while !rest.is_empty() {
            let (n, tail) = read_leb128(rest)?;
            let end = at.checked_add(n).filter(|end| *end <= total)?;
            if value {
                mask.set_run(at, end);
            }
            (at, value, rest) = (end, !value, tail);
        }
        (at == total).then_some(mask)
    }

    fn set_run(&mut self, from: u64, end: u64) {
        let mut at = from;
        while at < end {
            let n = (64 - at % 64).min(end - at);
            let ones = if n == 64 { u64::MAX } else { (1u64 << n) - 1 };
            let word = &mut self.words[(at / 64) as usize];
            self.used += u64::from((ones << (at % 64) & !*word).count_ones());
            *word |= ones << (at % 64);
            at += n;
        }
    }
}

fn min3(v: [f64; 3]) -> f64 {
    v[0].min(v[1]).min(v[2])
}

fn max3(v: [f64; 3]) -> f64 {
    v[0].max(v[1]).max(v[2])
}

/// Whole cells that the interval overlaps by more than the tolerance; a point or a sliver touches the cell it lies in.
fn touched(lo: f64, hi: f64) -> std::ops::Range<i64> {
    let first = (lo + TOUCH_TEXELS).floor() as i64;
    let last = ((hi - TOUCH_TEXELS).ceil() as i64).max(first + 1);
    first..last
}

/// Extent in x of the part of a triangle between two horizontals.
fn span_in_band(p: &[[f64; 2]; 3], top: f64, bottom: f64) -> Option<(f64, f64)> {
    let mut span: Option<(f64, f64)> = None;
    let mut add = |x: f64| span = Some(span.map_or((x, x), |(a, b)| (a.min(x), b.max(x))));
    for k in 0..3 {
        let (a, b) = (p[k], p[(k + 1) % 3]);
        if (top..=bottom).contains(&a[1]) {
            add(a[0]);
        }
        for y in [top, bottom] {
            if (a[1] - y) * (b[1] - y) < 0.0 {
                add(a[0] + (b[0] - a[0]) * ((y - a[1]) / (b[1] - a[1])));
            }
        }
    }
    span
}

/// The texel that a wrap mode puts at an index; `None` outside a texture with a border.
pub(crate) fn fold(i: i64, n: u32, wrap: Wrap) -> Option<u32> {
    let size = i64::from(n);
    match wrap {
        Wrap::Wrap => Some(i.rem_euclid(size) as u32),
        Wrap::Mirror => {
            let m = i.rem_euclid(2 * size);
            Some(if m < size { m } else { 2 * size - 1 - m } as u32)
        }
        Wrap::Clamp => Some(i.clamp(0, size - 1) as u32),
        Wrap::Border | Wrap::None => (0..size).contains(&i).then_some(i as u32),
    }
}

fn leb128(out: &mut Vec<u8>, mut n: u64) {
    while n >= 128 {
        out.push(n as u8 | 128);
        n >>= 7;
    }
    out.push(n as u8);
}

fn read_leb128(bytes: &[u8]) -> Option<(u64, &[u8])> {
    let mut n = 0u64;
    for (k, byte) in bytes.iter().enumerate().take(9) {
        n |= u64::from(byte & 127) << (7 * k);
        if byte & 128 == 0 {
            return Some((n, &bytes[k + 1..]));
        }
    }
    None
}
