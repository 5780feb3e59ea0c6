//! Resolve and shade: each (pixel, surface) once, at the centroid of the samples that the surface covers there. Neighbours in a row that show one
//! surface are shaded together.

use map3d_base::samples::SAMPLES;
use map3d_base::{Error, Isa, Result};
use map3d_image::GBuffer;
use map3d_texture::TextureCache;
use map3d_trace::visbuf::{MIXED, NOTHING};
use map3d_trace::{SUBTILE_PX, VisBuf};

use crate::paint::{Palette, Shaded};
use crate::seen::{Seen, Share};

/// Shades sub-tiles; buffers are kept.
pub struct Shader {
    palette: Palette,
    /// What the pixels of the sub-tile in hand show, if somebody asks.
    seen: Seen,
    keeps_seen: bool,
    /// Surfaces of the sub-tile in hand, and where each slot's stands among them.
    surfaces: Vec<Shaded>,
    of_slot: Vec<u32>,
    /// (pixel, surface) pairs shaded.
    pub shades: u64,
    /// Surfaces set up.
    pub setups: u64,
}

/// A slot whose surface has not been set up.
const UNKNOWN: u32 = u32::MAX;

/// A sub-tile on its way into the G-buffer, whose pixel `corner` is the sub-tile's first.
struct Scene<'a> {
    vis: &'a VisBuf,
    cache: &'a TextureCache,
    g: &'a mut GBuffer,
    corner: (usize, usize),
}

impl Shader {
    /// `keeps_seen`: `seen` is asked for.
    pub fn new(isa: Isa, keeps_seen: bool) -> Self {
        Self { palette: Palette::new(isa), seen: Seen::default(), keeps_seen, surfaces: Vec::new(), of_slot: Vec::new(), shades: 0, setups: 0 }
    }

    /// Shades a sub-tile into the arrays that the G-buffer has; its pixel `corner` (left, top) is the sub-tile's first.
    pub fn subtile(&mut self, vis: &VisBuf, cache: &TextureCache, g: &mut GBuffer, corner: (usize, usize)) -> Result<()> {
        self.surfaces.clear();
        self.seen.clear();
        self.of_slot.clear();
        self.of_slot.resize(vis.slot_count(), UNKNOWN);
        let done = self.rows(&mut Scene { vis, cache, g, corner });
        self.palette.held.release();
        done
    }

    fn rows(&mut self, scene: &mut Scene) -> Result<()> {
        for j in 0..SUBTILE_PX {
            let row = scene.vis.row(j);
            let mut i = 0;
            while i < SUBTILE_PX {
                let slot = row[i];
                let mut end = i + 1;
                if slot == MIXED {
                    self.mixed(scene, i, j)?;
                } else {
                    while end < SUBTILE_PX && row[end] == slot {
                        end += 1;
                    }
                    if slot != NOTHING {
                        self.run(scene, slot, i, end, j)?;
                    }
                }
                i = end;
            }
        }
        Ok(())
    }

    #[inline(always)]
    fn surface(&mut self, scene: &Scene, slot: u32) -> Result<&Shaded> {
        let at = match self.of_slot[slot as usize] {
            UNKNOWN => self.set_up(scene, slot)?,
            known => known,
        };
        Ok(&self.surfaces[at as usize])
    }

    #[inline(never)]
    fn set_up(&mut self, scene: &Scene, slot: u32) -> Result<u32> {
        let (surface, depth) = scene.vis.surface_and_depth(slot);
        let chunk = scene.vis.chunk(surface.chunk);
        let material = chunk.materials().get(surface.material as usize);
        let material = material.ok_or_else(|| Error::format(chunk.path(), format!("material {} of a triangle", surface.material)))?;
        let at = self.surfaces.len() as u32;
        self.surfaces.push(Shaded::new(&mut self.palette, scene.cache, material, &surface, depth, !scene.g.color.is_empty())?);
        self.of_slot[slot as usize] = at;
        self.setups += 1;
        Ok(at)
    }

    /// Pixels i..end of row j, all of whose samples meet one surface.
    #[inline(always)]
    fn run(&mut self, scene: &mut Scene, slot: u32, i: usize, end: usize, j: usize) -> Result<()> {
        self.shades += (end - i) as u64;
        let shaded = self.surface(scene, slot)?;
        let first = (scene.corner.1 + j) * scene.g.width as usize + scene.corner.0 + i;
        let pixels = first..first + end - i;
        shaded.depth.row(i, j, &mut scene.g.depth[pixels.clone()]);
        scene.g.id[pixels.clone()].fill(shaded.id);
        if !scene.g.normal.is_empty() {
            shaded.normals(i, j, &mut scene.g.normal[pixels.clone()]);
        }
        if !scene.g.color.is_empty() {
            shaded.paint.row(i, j, &mut scene.g.color[pixels.clone()]);
        }
        if self.keeps_seen {
            self.seen.push_run(j, i, end, self.of_slot[slot as usize]);
        }
        Ok(())
    }

    /// A pixel on an edge: colours weighed by the samples they cover; id, normal and depth of sample 0.
    #[inline(always)]
    fn mixed(&mut self, scene: &mut Scene, i: usize, j: usize) -> Result<()> {
        let slots = scene.vis.mixed(i, j);
        let at = (scene.corner.1 + j) * scene.g.width as usize + scene.corner.0 + i;
        let mut sum = [0u32; 4];
        let first = self.seen.shares.len();
        let mut todo = !VisBuf::samples_of(slots, NOTHING) & 0xFFFF;
        while todo != 0 {
            let slot = slots[todo.trailing_zeros() as usize & 15];
            let own = VisBuf::samples_of(slots, slot);
            todo &= !own;
            let (x, y) = centroid(own);
            self.shades += 1;
            let shaded = self.surface(scene, slot)?;
            let color = shaded.paint.at((i as i32) << 8 | x, (j as i32) << 8 | y);
            let weight = own.count_ones();
            (0..3).for_each(|c| sum[c] += u32::from(color[c]) * weight);
            sum[3] += 65_535 * weight;
            if self.keeps_seen {
                let (at, surface) = ([x, y].map(|v| v as u8), self.of_slot[slot as usize]);
                self.seen.shares.push(Share { at, samples: weight as u8, surface, color });
            }
        }
        if self.keeps_seen {
            self.seen.end_pixel(j, i, first);
        }
        if !scene.g.color.is_empty() {
            scene.g.color[at] = sum.map(|c| ((c + 8) >> 4) as u16);
        }
        if slots[0] != NOTHING {
            let shaded = self.surface(scene, slots[0])?;
            scene.g.id[at] = shaded.id;
            scene.g.depth[at] = shaded.depth.units(i, j);
            if !scene.g.normal.is_empty() {
                scene.g.normal[at] = shaded.normal_at(i, j);
            }
        }
        Ok(())
    }

    /// What the pixels of the sub-tile shaded last show, with the surfaces that they name. Nothing unless asked for.
    pub fn seen(&self) -> (&Seen, &[Shaded]) {
        (&self.seen, &self.surfaces)
    }

    /// The surface of the sub-tile shaded last that a slot stands for.
    pub fn surface_of(&self, slot: u32) -> &Shaded {
        &self.surfaces[self.of_slot[slot as usize] as usize]
    }
}

/// Sums of the x and y (in sixteenths) of the samples of masks of eight, the first and the last eight samples apart: x | y << 16.
const SUMS: [[u32; 256]; 2] = {
    let mut out = [[0; 256]; 2];
    let mut mask = 0;
    while mask < 256 {
        let mut k = 0;
        while k < 8 {
            if mask >> k & 1 == 1 {
                let (a, b) = (SAMPLES[k], SAMPLES[k + 8]);
                out[0][mask] += a.0 as u32 | (a.1 as u32) << 16;
                out[1][mask] += b.0 as u32 | (b.1 as u32) << 16;
            }
            k += 1;
        }
        mask += 1;
    }
    out
};

/// ⌈2^16 / n⌉: what it multiplies, below 4096, is divided by n exactly.
const SHARE: [u32; 32] = {
    let mut out = [0; 32];
    let mut n = 1;
    while n < 17 {
        out[n] = (1u32 << 16).div_ceil(n as u32);
        n += 1;
    }
    out
};

/// Mean of some samples in 1/256 px from the pixel's corner, to the nearest. Samples stand for the centres of strata around the pixel's centre:
/// all sixteen together give (128, 128).
#[inline(always)]
fn centroid(mask: u32) -> (i32, i32) {
    let n = mask.count_ones();
    if n == 16 {
        return (128, 128);
    }
    let sums = SUMS[0][mask as usize & 255] + SUMS[1][mask as usize >> 8 & 255];
    let mean = |sum: u32| (((sum * 16 + n / 2) * SHARE[n as usize & 31]) >> 16) as i32;
    (mean(sums & 0xFFFF), mean(sums >> 16))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn centroids_are_means_to_the_nearest() {
        for mask in 1..0xFFFFu32 {
            let chosen: Vec<u32> = (0..16).filter(|k| mask >> k & 1 == 1).collect();
            let mean = |axis: fn(&(u8, u8)) -> u8| {
                let sum: u32 = chosen.iter().map(|k| u32::from(axis(&SAMPLES[*k as usize]))).sum();
                ((sum * 16 + chosen.len() as u32 / 2) / chosen.len() as u32) as i32
            };
            assert_eq!(centroid(mask), (mean(|s| s.0), mean(|s| s.1)), "{mask:016b}");
        }
        assert_eq!(centroid(0xFFFF), (128, 128));
    }
}
