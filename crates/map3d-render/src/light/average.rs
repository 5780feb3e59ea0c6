//! Averages of light over the covered samples of each pixel.

use map3d_base::Vec3;
use map3d_base::layers::{COLOR, PICTURE};
use map3d_image::GBuffer;

use super::unprojection::SubtilePosition;
use crate::fragments::{Fragment, FragmentBuffer, RunContent};
use crate::material::PreparedSurface;

/// Linear light of a picture, in 1/65536.
const AMBIENT: u64 = 27_525;
const DIFFUSE: u64 = 49_807;

/// Functions that return the light of a whole pixel (i, j), and of a fragment by its number.
pub(super) struct LightValues<P, F> {
    pub pixel: P,
    pub fragment: F,
}

/// The light of a picture at a point.
#[derive(Clone, Copy)]
pub(super) struct PictureLight {
    /// Whether the sun lights the point.
    pub is_lit: bool,
    /// Ambient visibility, 0 to 1.
    pub ambient: f32,
}

/// Writes the means of values from 0 to 1 as 0 to 255.
pub(super) fn average<P, F>(buffer: &FragmentBuffer, values: LightValues<P, F>, out: &mut [u8], width: u32, position: SubtilePosition)
where
    P: Fn(usize, usize) -> f32,
    F: Fn(usize) -> f32,
{
    for run in &buffer.runs {
        let (j, first) = (run.row.into(), position.index(width, run.first.into(), run.row.into()));
        match run.content {
            RunContent::Surface(_) => {
                let out = &mut out[first..][..run.columns().len()];
                for (out, i) in out.iter_mut().zip(run.columns()) {
                    *out = ((values.pixel)(i, j) * 255.0 + 0.5) as u8;
                }
            }
            RunContent::Fragments { first: start, end } => {
                let (mut sum, mut samples) = (0.0, 0.0);
                for k in start as usize..end as usize {
                    let weight = f32::from(buffer.fragments[k].samples);
                    sum += weight * (values.fragment)(k);
                    samples += weight;
                }
                out[first] = (sum / samples * 255.0 + 0.5) as u8;
            }
        }
    }
}

/// Writes colours times light, averaged over each pixel. The colours of whole pixels are those in the G-buffer.
pub(super) fn light_picture<P, F>(
    buffer: &FragmentBuffer,
    surfaces: &[PreparedSurface],
    sun: Vec3,
    values: LightValues<P, F>,
    g: &mut GBuffer,
    position: SubtilePosition,
) where
    P: Fn(usize, usize) -> PictureLight,
    F: Fn(usize) -> PictureLight,
{
    for run in &buffer.runs {
        let (j, first) = (run.row.into(), position.index(g.width, run.first.into(), run.row.into()));
        let light = |i: usize, surface: u32, value: PictureLight| {
            let cosine = if value.is_lit { u64::from(surfaces[surface as usize].cosine(i, j, sun)) } else { 0 };
            AMBIENT * (f64::from(value.ambient) * 65_536.0) as u64 + DIFFUSE * cosine
        };
        match run.content {
            RunContent::Surface(surface) => {
                for (at, i) in (first..).zip(run.columns()) {
                    let [r, green, b, _] = g[COLOR][at];
                    let [r, green, b] = multiply([r, green, b], light(i, surface, (values.pixel)(i, j)));
                    g[PICTURE][at] = [r as u16, green as u16, b as u16, 65_535];
                }
            }
            RunContent::Fragments { first: start, end } => {
                let mut sum = [0u64; 4];
                for k in start as usize..end as usize {
                    let Fragment { samples, surface, color, .. } = buffer.fragments[k];
                    let color = multiply(color, light(run.first.into(), surface, (values.fragment)(k)));
                    (0..3).for_each(|c| sum[c] += color[c] * u64::from(samples));
                    sum[3] += 65_535 * u64::from(samples);
                }
                g[PICTURE][first] = sum.map(|c| ((c + 8) >> 4) as u16);
            }
        }
    }
}

/// Multiplies a colour by light in 2^-32, limited to 65535.
fn multiply(color: [u16; 3], light: u64) -> [u64; 3] {
    color.map(|c| ((u64::from(c) * light + (1 << 31)) >> 32).min(65_535))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fragments::PixelRun;

    #[test]
    fn pixel_is_the_mean_of_its_fragments() {
        let mut buffer = FragmentBuffer::default();
        buffer.push_run(1, 0, 1, 0);
        buffer.runs.push(PixelRun { row: 1, first: 1, end: 2, content: RunContent::Fragments { first: 0, end: 2 } });
        buffer.runs.push(PixelRun { row: 1, first: 2, end: 3, content: RunContent::Fragments { first: 2, end: 3 } });
        buffer.fragments.extend([4, 4, 3].map(|samples| Fragment { centroid: [128; 2], samples, surface: 0, color: [0; 3] }));
        let mut out = vec![7; 4 * 4];
        let values = LightValues { pixel: |_, _| 0.5, fragment: |k: usize| [1.0, 0.0, 1.0][k] };
        average(&buffer, values, &mut out, 4, SubtilePosition { in_tile: (1, 2), in_view: [0; 2] });
        assert_eq!(&out[12..], &[7, 128, 128, 255]);
        assert!(out[..12].iter().all(|v| *v == 7));
    }
}
