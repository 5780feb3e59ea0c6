//! Means over the covered samples of each pixel.

use map3d_base::Vec3;
use map3d_image::GBuffer;

use super::place::Place;
use crate::paint::Shaded;
use crate::seen::{Seen, Share, Shows};

/// Linear light of a picture, in 1/65536.
const AMBIENT: u64 = 27_525;
const DIFFUSE: u64 = 49_807;

/// What is known of a whole pixel (i, j), and of a share by its number.
pub(super) struct Known<P, S> {
    pub pixel: P,
    pub share: S,
}

/// 255 is 1.
pub(super) fn average<P, S>(seen: &Seen, known: Known<P, S>, out: &mut [u8], width: u32, place: Place)
where
    P: Fn(usize, usize) -> f32,
    S: Fn(usize) -> f32,
{
    for run in &seen.runs {
        let (j, first) = (run.row.into(), place.index(width, run.first.into(), run.row.into()));
        match run.shows {
            Shows::One(_) => {
                let out = &mut out[first..][..run.columns().len()];
                for (out, i) in out.iter_mut().zip(run.columns()) {
                    *out = ((known.pixel)(i, j) * 255.0 + 0.5) as u8;
                }
            }
            Shows::Several { first: start, end } => {
                let (mut sum, mut all) = (0.0, 0.0);
                for k in start as usize..end as usize {
                    let weight = f32::from(seen.shares[k].samples);
                    sum += weight * (known.share)(k);
                    all += weight;
                }
                out[first] = (sum / all * 255.0 + 0.5) as u8;
            }
        }
    }
}

/// Colours times light, averaged over each pixel. `known`: whether the sun lights it, and how open it is. Whole pixels have their colours in the G-buffer.
pub(super) fn picture<P, S>(seen: &Seen, shaded: &[Shaded], sun: Vec3, known: Known<P, S>, g: &mut GBuffer, place: Place)
where
    P: Fn(usize, usize) -> (bool, f32),
    S: Fn(usize) -> (bool, f32),
{
    for run in &seen.runs {
        let (j, first) = (run.row.into(), place.index(g.width, run.first.into(), run.row.into()));
        let light = |i: usize, surface: u32, (is_lit, open): (bool, f32)| {
            let cosine = if is_lit { u64::from(shaded[surface as usize].cosine(i, j, sun)) } else { 0 };
            AMBIENT * (f64::from(open) * 65_536.0) as u64 + DIFFUSE * cosine
        };
        match run.shows {
            Shows::One(surface) => {
                for (at, i) in (first..).zip(run.columns()) {
                    let [r, green, b, _] = g.color[at];
                    let [r, green, b] = lit([r, green, b], light(i, surface, (known.pixel)(i, j)));
                    g.picture[at] = [r as u16, green as u16, b as u16, 65_535];
                }
            }
            Shows::Several { first: start, end } => {
                let mut sum = [0u64; 4];
                for k in start as usize..end as usize {
                    let Share { samples, surface, color, .. } = seen.shares[k];
                    let color = lit(color, light(run.first.into(), surface, (known.share)(k)));
                    (0..3).for_each(|c| sum[c] += color[c] * u64::from(samples));
                    sum[3] += 65_535 * u64::from(samples);
                }
                g.picture[first] = sum.map(|c| ((c + 8) >> 4) as u16);
            }
        }
    }
}

/// A colour times light in 2^-32, at most 65535.
fn lit(color: [u16; 3], light: u64) -> [u64; 3] {
    color.map(|c| ((u64::from(c) * light + (1 << 31)) >> 32).min(65_535))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seen::Run;

    #[test]
    fn a_pixel_is_the_mean_of_its_surfaces() {
        let mut seen = Seen::default();
        seen.push_run(1, 0, 1, 0);
        seen.runs.push(Run { row: 1, first: 1, end: 2, shows: Shows::Several { first: 0, end: 2 } });
        seen.runs.push(Run { row: 1, first: 2, end: 3, shows: Shows::Several { first: 2, end: 3 } });
        seen.shares.extend([4, 4, 3].map(|samples| Share { at: [128; 2], samples, surface: 0, color: [0; 3] }));
        let mut out = vec![7; 4 * 4];
        let known = Known { pixel: |_, _| 0.5, share: |k: usize| [1.0, 0.0, 1.0][k] };
        average(&seen, known, &mut out, 4, Place { corner: (1, 2), corner_px: [0; 2] });
        assert_eq!(&out[12..], &[7, 128, 128, 255]);
        assert!(out[..12].iter().all(|v| *v == 7));
    }
}
