//! Resolve and shading: each (pixel, surface) pair is shaded once, at the centroid of the samples that the surface covers in the pixel. Neighbouring pixels
//! of a row that show one surface are shaded together.
//!
//! The contract of `Shader::shade_subtile`:
//!
//! * It takes a `VisBuf` and the place of its first pixel in a G-buffer, and fills the arrays that the G-buffer has; the others are not computed.
//! * Id, normal and depth are those of sample 0, the pixel's centre. Colour is the mean over the `SampleSet` of the surfaces' colours at their centroids.
//! * Pixels without a surface keep their values: the caller clears the arrays.
//! * Colours have no light; `LightTracer` adds shadows and ambient occlusion at the `fragments` of the sub-tile.
//! * The result depends on the `VisBuf` and the textures alone. The order in which surfaces are shaded, by texture, does not change it.
//! * It fails if a material or texture cannot be read.

use std::ops::Range;

use map3d_base::samples::SAMPLES;
use map3d_base::{Error, Isa, Projection, Result};
use map3d_image::{GBuffer, SurfaceArrays};
use map3d_scene::MaterialRecord;
use map3d_texture::TextureCache;
use map3d_trace::{MIXED, NOTHING, SUBTILE_PX, SurfaceAttributes, VisBuf};

use crate::edge_samples::EdgeSamples;
use crate::fragments::{Fragment, FragmentBuffer};
use crate::material::{MaterialCache, PreparedSurface, clamp_at_edges};
use crate::surface_order::SurfaceOrder;

/// Shades sub-tiles. Keep one per thread to reuse its buffers.
pub struct Shader {
    materials: MaterialCache,
    /// Fragments of the current sub-tile; empty unless `keeps_fragments`.
    fragments: FragmentBuffer,
    keeps_fragments: bool,
    /// Visible surfaces of the current sub-tile, row by row.
    runs: Vec<SurfaceRun>,
    order: SurfaceOrder,
    edges: EdgeSamples,
    /// Prepared surfaces of the current sub-tile.
    surfaces: Vec<PreparedSurface>,
    /// Index into `surfaces` of each slot, or `NOT_PREPARED`.
    surface_of_slot: Vec<u32>,
    /// Those whose mean is a pixel's colour.
    samples: SampleSet,
    /// Shaded (pixel, surface) pairs.
    pub shades: u64,
    /// Prepared surfaces.
    pub setups: u64,
}

/// The samples whose mean is a pixel's colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampleSet {
    mask: u32,
    /// Binary logarithm of their number.
    bits: u32,
}

impl SampleSet {
    pub const ALL: Self = Self { mask: 0xFFFF, bits: 4 };
    /// One in each quarter of the pixel.
    pub const FOUR: Self = Self { mask: 1 << 6 | 1 << 8 | 1 << 10 | 1 << 14, bits: 2 };
    /// The pixel's centre.
    pub const CENTER: Self = Self { mask: 1, bits: 0 };
}

/// Pixels of a row whose samples all show one surface.
#[derive(Clone, Copy)]
struct SurfaceRun {
    /// Index into the sub-tile's surfaces.
    surface: u32,
    row: u8,
    first: u8,
    end: u8,
}

const NOT_PREPARED: u32 = u32::MAX;

/// A sub-tile and the G-buffer that it is shaded into.
struct SubtileTarget<'a> {
    vis: &'a VisBuf,
    textures: &'a TextureCache,
    g: SurfaceArrays<'a>,
    /// Width of the G-buffer.
    width: usize,
    /// The sub-tile's first pixel in the G-buffer: left, top.
    corner: (usize, usize),
}

impl SubtileTarget<'_> {
    /// Returns the index of pixel (i, j) in the G-buffer.
    #[inline(always)]
    fn index(&self, i: usize, j: usize) -> usize {
        (self.corner.1 + j) * self.width + self.corner.0 + i
    }
}

impl Shader {
    /// `keeps_fragments`: the caller needs `fragments`.
    pub fn new(isa: Isa, view: &Projection, keeps_fragments: bool, samples: SampleSet) -> Self {
        let materials = match view {
            Projection::Parallel(_) => MaterialCache::new(isa),
            Projection::Perspective(_) => MaterialCache::in_perspective(isa),
        };
        Self {
            samples,
            materials,
            fragments: FragmentBuffer::default(),
            keeps_fragments,
            runs: Vec::new(),
            order: SurfaceOrder::default(),
            edges: EdgeSamples::default(),
            surfaces: Vec::new(),
            surface_of_slot: Vec::new(),
            shades: 0,
            setups: 0,
        }
    }

    /// Shades a sub-tile into the arrays of the G-buffer; `corner` (left, top) is the sub-tile's first pixel there.
    pub fn shade_subtile(&mut self, vis: &VisBuf, textures: &TextureCache, g: &mut GBuffer, corner: (usize, usize)) -> Result<()> {
        // Forget the last sub-tile
        self.surfaces.clear();
        self.fragments.clear();
        self.runs.clear();
        self.edges.clear();
        self.surface_of_slot.clear();
        self.surface_of_slot.resize(vis.slot_count(), NOT_PREPARED);

        // Find what each pixel shows, then shade it
        let mut target = SubtileTarget { vis, textures, width: g.width as usize, g: g.surface_arrays(), corner };
        let done = self.split_rows(&mut target).and_then(|()| self.shade_surfaces(&mut target));
        self.materials.finish_subtile();
        done
    }

    /// Splits each row into runs of pixels with one slot, and pixels with several.
    fn split_rows(&mut self, target: &mut SubtileTarget) -> Result<()> {
        for j in 0..SUBTILE_PX {
            let row = target.vis.row(j);
            let mut i = 0;
            while i < SUBTILE_PX {
                let slot = row[i];
                let mut end = i + 1;
                if slot == MIXED {
                    self.shade_mixed_pixel(target, i, j)?;
                } else {
                    while end < SUBTILE_PX && row[end] == slot {
                        end += 1;
                    }
                    if slot != NOTHING {
                        self.add_run(target, slot, i..end, j)?;
                    }
                }
                i = end;
            }
        }
        Ok(())
    }

    /// Returns the index of a slot's prepared surface.
    #[inline(always)]
    fn surface(&mut self, target: &SubtileTarget, slot: u32) -> Result<usize> {
        let index = match self.surface_of_slot[slot as usize] {
            NOT_PREPARED => self.prepare(target, slot)?,
            index => index,
        };
        Ok(index as usize)
    }

    #[inline(never)]
    fn prepare(&mut self, target: &SubtileTarget, slot: u32) -> Result<u32> {
        let needs_color = !target.g.color.is_empty();
        let (materials, textures) = (&mut self.materials, target.textures);
        let prepared = match target.vis.view() {
            Projection::Parallel(_) => {
                let (surface, depth) = target.vis.surface_and_depth(slot);
                PreparedSurface::new(materials, textures, &material_of(target.vis, &surface)?, &surface, depth, needs_color)?
            }
            Projection::Perspective(_) => {
                let surface = target.vis.curved_surface(slot);
                PreparedSurface::curved(materials, textures, &material_of(target.vis, &surface.attributes)?, surface, needs_color)?
            }
        };
        let index = self.surfaces.len() as u32;
        self.surfaces.push(prepared);
        self.surface_of_slot[slot as usize] = index;
        self.setups += 1;
        Ok(index)
    }

    /// Adds pixels of row j whose samples all show one surface.
    #[inline(always)]
    fn add_run(&mut self, target: &SubtileTarget, slot: u32, columns: Range<usize>, j: usize) -> Result<()> {
        self.shades += columns.len() as u64;
        let surface = self.surface(target, slot)? as u32;
        self.runs.push(SurfaceRun { surface, row: j as u8, first: columns.start as u8, end: columns.end as u8 });
        if self.keeps_fragments {
            self.fragments.push_run(j, columns.start, columns.end, surface);
        }
        Ok(())
    }

    /// Shades what the rows were split into, surface by surface: a sampler is faster where it stays with one texture.
    fn shade_surfaces(&mut self, target: &mut SubtileTarget) -> Result<()> {
        let has_color = !target.g.color.is_empty();
        let Self { surfaces, materials, runs, order, edges, fragments, .. } = self;
        // Sort runs and edge samples by surface
        order.sort(surfaces.len(), runs.iter().map(|run| run.surface));
        edges.sort(surfaces.len());

        // Shade each surface
        for (number, surface) in surfaces.iter().enumerate() {
            for run in order.of(number) {
                shade_run(surface, runs[*run as usize], target, materials)?;
            }
            if has_color {
                edges.shade(number, surface, materials, target.textures, &mut fragments.fragments)?;
            }
        }

        // Average the edge samples of each pixel
        if has_color {
            edges.resolve(self.samples.bits, target.g.color);
        }
        Ok(())
    }

    /// Resolves a pixel on an edge: id, normal and depth of sample 0. Its colour is the mean of the surfaces' colours, weighted by their samples; `shade_surfaces`
    /// computes it.
    #[inline(always)]
    fn shade_mixed_pixel(&mut self, target: &mut SubtileTarget, i: usize, j: usize) -> Result<()> {
        let slots = target.vis.mixed(i, j);
        let at = target.index(i, j);
        self.add_edge_samples(target, slots, [i, j])?;

        // The other arrays show the pixel's centre.
        if slots[0] != NOTHING {
            let index = self.surface(target, slots[0])?;
            let surface = &self.surfaces[index];
            target.g.id[at] = surface.id;
            target.g.depth[at] = surface.depth.units(i, j);
            if !target.g.normal.is_empty() {
                target.g.normal[at] = surface.normal_at(i, j);
            }
        }
        Ok(())
    }

    /// Adds the surfaces of a pixel, each at the centroid of its samples.
    #[inline(always)]
    fn add_edge_samples(&mut self, target: &SubtileTarget, slots: &[u32; 16], [i, j]: [usize; 2]) -> Result<()> {
        self.edges.begin_pixel(target.index(i, j));
        let first = self.fragments.fragments.len();
        let SampleSet { mask, bits } = self.samples;
        let mut rest = !VisBuf::samples_of(slots, NOTHING) & mask;
        while rest != 0 {
            let slot = slots[rest.trailing_zeros() as usize & 15];
            let covered = VisBuf::samples_of(slots, slot) & mask;
            rest &= !covered;
            let (x, y) = centroid(covered);
            self.shades += 1;
            let index = self.surface(target, slot)?;
            let weight = covered.count_ones();
            self.edges.push([(i as i32) << 8 | x, (j as i32) << 8 | y], weight, index);
            if self.keeps_fragments {
                let (centroid, surface) = ([x, y].map(|v| v as u8), index as u32);
                let samples = (weight << (4 - bits)) as u8;
                self.fragments.fragments.push(Fragment { centroid, samples, surface, color: [0; 3] });
            }
        }
        if self.keeps_fragments {
            self.fragments.finish_pixel(j, i, first);
            self.edges.link_fragments(first, self.fragments.fragments.len() - first);
        }
        Ok(())
    }

    /// The fragments of the sub-tile shaded last; empty unless `new` was called with `keeps_fragments`.
    pub fn fragments(&self) -> &FragmentBuffer {
        &self.fragments
    }

    /// The surfaces of the sub-tile shaded last, which `fragments` refers to.
    pub fn surfaces(&self) -> &[PreparedSurface] {
        &self.surfaces
    }

    /// Returns the surface of a slot in the sub-tile shaded last.
    pub fn surface_of_slot(&self, slot: u32) -> &PreparedSurface {
        &self.surfaces[self.surface_of_slot[slot as usize] as usize]
    }
}

/// Shades whole pixels.
#[inline(always)]
fn shade_run(surface: &PreparedSurface, run: SurfaceRun, target: &mut SubtileTarget, materials: &mut MaterialCache) -> Result<()> {
    let (i, j) = (usize::from(run.first), usize::from(run.row));
    let first = target.index(i, j);
    let pixels = first..first + usize::from(run.end - run.first);
    surface.depth.row(i, j, &mut target.g.depth[pixels.clone()]);
    target.g.id[pixels.clone()].fill(surface.id);
    if !target.g.normal.is_empty() {
        surface.normals(i, j, &mut target.g.normal[pixels.clone()]);
    }
    if !target.g.color.is_empty() {
        surface.color.row(i, j, &mut target.g.color[pixels], materials, target.textures)?;
    }
    Ok(())
}

/// Returns the material of a surface, with the wrap mode of its colours.
fn material_of(vis: &VisBuf, surface: &SurfaceAttributes) -> Result<MaterialRecord> {
    let chunk = vis.chunk(surface.chunk);
    let material = chunk.materials().get(surface.material as usize).ok_or_else(|| {
        let (number, count) = (surface.material, chunk.materials().len());
        Error::format(chunk.path(), format!("a triangle has material {number}, but the chunk has {count} materials; rebuild the scene"))
    })?;
    Ok(clamp_at_edges(material, &chunk.triangles()[surface.triangle as usize].uv))
}

/// Sums of the x and y (in 1/16 px) of the samples of a mask of eight, for the first and for the last eight samples: x | y << 16.
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

/// ⌈2^16 / n⌉. Multiplying a number below 4096 by it and shifting right by 16 divides by n exactly.
const RECIPROCAL: [u32; 32] = {
    let mut out = [0; 32];
    let mut n = 1;
    while n < 17 {
        out[n] = (1u32 << 16).div_ceil(n as u32);
        n += 1;
    }
    out
};

/// Returns the mean position of a mask's samples in 1/256 px from the pixel's corner, rounded to the nearest. All sixteen samples together represent the
/// whole pixel: (128, 128).
#[inline(always)]
fn centroid(mask: u32) -> (i32, i32) {
    let n = mask.count_ones();
    if n == 16 {
        return (128, 128);
    }
    let sums = SUMS[0][mask as usize & 255] + SUMS[1][mask as usize >> 8 & 255];
    let mean = |sum: u32| (((sum * 16 + n / 2) * RECIPROCAL[n as usize & 31]) >> 16) as i32;
    (mean(sums & 0xFFFF), mean(sums >> 16))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn centroid_is_the_rounded_mean() {
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
