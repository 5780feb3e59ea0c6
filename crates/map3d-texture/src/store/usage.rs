//! Marks the texels of an image that the UV triangles of a scene touch (spec/scene.md, Texture).

use std::ops::Range;

use map3d_base::asset::Wrap;
use map3d_image::PixelMask;

use crate::wrap::wrap_texel;

/// A triangle that crosses a texel's border by less than this (in texels) does not touch the neighbour: float32 noise.
const TOUCH_TEXELS: f64 = 1.0 / 512.0;
/// A triangle over more rows than this (before wrapping) uses every texel.
const MAX_ROWS: f64 = 4_194_304.0;

/// Marks the texels that a triangle touches. UVs: u right, v up, origin at the lower left corner of the image. Ignores UVs that are not finite.
pub fn mark_triangle(mask: &mut PixelMask, uv: [[f32; 2]; 3], wrap: Wrap) {
    if mask.is_full() || !uv.as_flattened().iter().all(|c| c.is_finite()) {
        return;
    }
    // The triangle in texels (right, down).
    let (w, h) = (f64::from(mask.width()), f64::from(mask.height()));
    let p = uv.map(|c| [f64::from(c[0]) * w, (1.0 - f64::from(c[1])) * h]);
    let rows = Interval::around(p.map(|c| c[1]));
    if rows.length() > MAX_ROWS || p.as_flattened().iter().any(|c| c.abs() > 1e12) {
        return mask.mark_all();
    }
    // Row by row, the columns between its leftmost and its rightmost point.
    for row in touched(clip_rows(rows, h, wrap)) {
        let Some(columns) = extent_in_band(&p, band_of_row(row, mask.height(), rows, wrap)) else { continue };
        if let Some(y) = wrap_texel(row, mask.height(), wrap) {
            mark_extent(mask, y, columns, wrap);
        }
    }
}

#[derive(Clone, Copy)]
struct Interval {
    low: f64,
    high: f64,
}

impl Interval {
    fn around(values: [f64; 3]) -> Self {
        Self { low: values[0].min(values[1]).min(values[2]), high: values[0].max(values[1]).max(values[2]) }
    }

    fn length(self) -> f64 {
        self.high - self.low
    }

    /// Clamps to a row of `n` texels and one texel on either side.
    fn clip(self, n: f64) -> Self {
        Self { low: self.low.clamp(-1.0, n + 1.0), high: self.high.clamp(-1.0, n + 1.0) }
    }
}

/// Limits the rows of a texture that does not repeat to its own.
fn clip_rows(rows: Interval, h: f64, wrap: Wrap) -> Interval {
    match wrap {
        Wrap::Wrap | Wrap::Mirror => rows,
        Wrap::Clamp => Interval { low: rows.low.clamp(0.0, h - 0.5), high: rows.high.clamp(0.5, h) },
        Wrap::Border | Wrap::None => rows.clip(h),
    }
}

/// Returns the heights that show a row of texels: its own; with `Wrap::Clamp` the first and last rows also show everything beyond them.
fn band_of_row(row: i64, height: u32, rows: Interval, wrap: Wrap) -> Interval {
    let own = Interval { low: row as f64, high: row as f64 + 1.0 };
    let clamp = wrap == Wrap::Clamp;
    Interval {
        low: if clamp && row == 0 { rows.low.min(0.0) } else { own.low },
        high: if clamp && row == i64::from(height) - 1 { rows.high.max(own.high) } else { own.high },
    }
}

/// Returns the extent in x of the part of a triangle within a horizontal band.
fn extent_in_band(p: &[[f64; 2]; 3], band: Interval) -> Option<Interval> {
    let mut extent: Option<Interval> = None;
    let mut add = |x: f64| extent = Some(extent.map_or(Interval { low: x, high: x }, |e| Interval { low: e.low.min(x), high: e.high.max(x) }));
    for k in 0..3 {
        let (a, b) = (p[k], p[(k + 1) % 3]);
        if (band.low..=band.high).contains(&a[1]) {
            add(a[0]);
        }
        for y in [band.low, band.high] {
            if (a[1] - y) * (b[1] - y) < 0.0 {
                add(a[0] + (b[0] - a[0]) * ((y - a[1]) / (b[1] - a[1])));
            }
        }
    }
    extent
}

/// Returns the whole texels that an interval overlaps by more than the tolerance; a point or a sliver touches the texel that contains it.
fn touched(interval: Interval) -> Range<i64> {
    let first = (interval.low + TOUCH_TEXELS).floor() as i64;
    let last = ((interval.high - TOUCH_TEXELS).ceil() as i64).max(first + 1);
    first..last
}

fn mark_extent(mask: &mut PixelMask, y: u32, extent: Interval, wrap: Wrap) {
    let w = f64::from(mask.width());
    let repeats = matches!(wrap, Wrap::Wrap | Wrap::Mirror);
    let period = if wrap == Wrap::Mirror { 2.0 * w } else { w };
    match repeats {
        true if extent.length() >= period => mask.mark_row(y, 0..mask.width()),
        true => mark_columns(mask, y, touched(extent), wrap),
        false => mark_columns(mask, y, touched(extent.clip(w)), wrap),
    }
}

/// Marks the texels that a wrap mode puts at columns of a row: at least one column, and little more than a period.
fn mark_columns(mask: &mut PixelMask, y: u32, columns: Range<i64>, wrap: Wrap) {
    let w = i64::from(mask.width());
    let mut mark = |from: i64, end: i64| mask.mark_row(y, from as u32..end as u32);
    match wrap {
        Wrap::Clamp => mark(columns.start.clamp(0, w - 1), (columns.end - 1).clamp(0, w - 1) + 1),
        Wrap::Border | Wrap::None => mark(columns.start.clamp(0, w), columns.end.clamp(0, w)),
        Wrap::Wrap => {
            let start = columns.start.rem_euclid(w);
            let end = start + columns.end - columns.start;
            mark(start, end.min(w));
            mark(0, (end - w).clamp(0, w));
        }
        Wrap::Mirror => columns.filter_map(|column| wrap_texel(column, w as u32, wrap)).for_each(|x| mask.mark(x, y)),
    }
}
