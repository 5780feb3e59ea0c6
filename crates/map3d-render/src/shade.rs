//! Resolve and shade: each (pixel, surface) once, at the centroid of the samples that the surface covers there.

use map3d_base::samples::SAMPLES;
use map3d_base::{Error, Result};
use map3d_image::GBuffer;
use map3d_image::texture::TextureCache;
use map3d_trace::visbuf::NOTHING;
use map3d_trace::{Pixel, SUBTILE_PX, VisBuf};

use crate::paint::Shaded;

/// Surfaces of the sub-tile in hand; buffers are kept.
#[derive(Default)]
pub struct Shader {
    surfaces: Vec<Option<Shaded>>,
    /// (pixel, surface) pairs shaded.
    pub shades: u64,
    /// Surfaces set up.
    pub setups: u64,
}

impl Shader {
    /// Shades a sub-tile into the G-buffer, whose pixel (left, top) is the sub-tile's first.
    pub fn subtile(&mut self, vis: &VisBuf, cache: &TextureCache, g: &mut GBuffer, (left, top): (usize, usize)) -> Result<()> {
        self.surfaces.clear();
        self.surfaces.resize_with(vis.slot_count(), || None);
        for j in 0..SUBTILE_PX {
            let row = (top + j) * g.width as usize + left;
            for i in 0..SUBTILE_PX {
                match vis.pixel(i, j) {
                    Pixel::Nothing => {}
                    Pixel::One(slot) => self.whole(vis, cache, slot, [i, j], g, row + i)?,
                    Pixel::Mixed(slots) => self.mixed(vis, cache, slots, [i, j], g, row + i)?,
                }
            }
        }
        Ok(())
    }

    #[inline(always)]
    fn surface(&mut self, vis: &VisBuf, cache: &TextureCache, slot: u32) -> Result<&Shaded> {
        if self.surfaces[slot as usize].is_none() {
            self.set_up(vis, cache, slot)?;
        }
        Ok(self.surfaces[slot as usize].as_ref().expect("set up above"))
    }

    #[inline(never)]
    fn set_up(&mut self, vis: &VisBuf, cache: &TextureCache, slot: u32) -> Result<()> {
        let surface = vis.surface(slot);
        let chunk = vis.chunk(surface.chunk);
        let material = chunk.materials().get(surface.material as usize);
        let material = material.ok_or_else(|| Error::format(chunk.path(), format!("material {} of a triangle", surface.material)))?;
        self.surfaces[slot as usize] = Some(Shaded::new(cache, material, &surface, vis.depth_plane(slot))?);
        self.setups += 1;
        Ok(())
    }

    /// A pixel all of whose samples meet one surface.
    #[inline(always)]
    fn whole(&mut self, vis: &VisBuf, cache: &TextureCache, slot: u32, [i, j]: [usize; 2], g: &mut GBuffer, at: usize) -> Result<()> {
        self.shades += 1;
        let shaded = self.surface(vis, cache, slot)?;
        let [r, green, b] = shaded.paint.at((i as i32) << 8 | 128, (j as i32) << 8 | 128);
        g.color[at] = [r, green, b, 65_535];
        g.id[at] = shaded.id;
        g.normal[at] = shaded.normal_at(i, j);
        g.depth[at] = shaded.depth.units(i, j);
        Ok(())
    }

    /// A pixel on an edge: colours weighed by the samples they cover; id, normal and depth of sample 0.
    fn mixed(&mut self, vis: &VisBuf, cache: &TextureCache, slots: &[u32; 16], [i, j]: [usize; 2], g: &mut GBuffer, at: usize) -> Result<()> {
        let mut sum = [0u32; 4];
        let mut todo = mask_of(slots, |s| s != NOTHING);
        while todo != 0 {
            let slot = slots[todo.trailing_zeros() as usize];
            let own = mask_of(slots, |s| s == slot);
            todo &= !own;
            let (x, y) = centroid(own);
            self.shades += 1;
            let color = self.surface(vis, cache, slot)?.paint.at((i as i32) << 8 | x, (j as i32) << 8 | y);
            let weight = own.count_ones();
            (0..3).for_each(|c| sum[c] += u32::from(color[c]) * weight);
            sum[3] += 65_535 * weight;
        }
        g.color[at] = sum.map(|c| ((c + 8) >> 4) as u16);
        if slots[0] != NOTHING {
            let shaded = self.surface(vis, cache, slots[0])?;
            g.id[at] = shaded.id;
            g.normal[at] = shaded.normal_at(i, j);
            g.depth[at] = shaded.depth.units(i, j);
        }
        Ok(())
    }
}

#[inline(always)]
fn mask_of(slots: &[u32; 16], keep: impl Fn(u32) -> bool) -> u32 {
    slots.iter().enumerate().fold(0, |mask, (k, slot)| mask | u32::from(keep(*slot)) << k)
}

/// Mean of some samples in 1/256 px from the pixel's corner, to the nearest. Samples stand for the centres of strata around the pixel's centre:
/// all sixteen together give (128, 128).
fn centroid(mask: u32) -> (i32, i32) {
    let n = mask.count_ones();
    if n == 16 {
        return (128, 128);
    }
    let chosen = SAMPLES.iter().enumerate().filter(|(k, _)| mask >> k & 1 == 1);
    let (x, y) = chosen.fold((0, 0), |(x, y), (_, s)| (x + u32::from(s.0), y + u32::from(s.1)));
    let mean = |sum: u32| ((sum * 16 + n / 2) / n) as i32;
    (mean(x), mean(y))
}
