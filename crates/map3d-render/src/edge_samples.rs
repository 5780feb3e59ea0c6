//! Samples of a sub-tile's pixels on edges: gathered pixel by pixel, then shaded surface by surface, because a sampler is faster in runs.

use map3d_base::Result;
use map3d_texture::TextureCache;

use crate::fragments::Fragment;
use crate::material::{MaterialCache, PreparedSurface};
use crate::surface_order::SurfaceOrder;

/// One surface within a pixel.
#[derive(Clone, Copy)]
struct EdgeSample {
    /// Index into `pixels`.
    pixel: u32,
    /// Index into the sub-tile's surfaces.
    surface: u32,
    /// Index into the sub-tile's fragments, or `NO_FRAGMENT`.
    fragment: u32,
    /// Number of the pixel's samples that show the surface.
    weight: u32,
    /// In 2^-8 px from the sub-tile's corner.
    position: [i32; 2],
}

const NO_FRAGMENT: u32 = u32::MAX;

/// The weighted sum of a pixel's colours.
struct EdgePixel {
    /// Index into the G-buffer.
    at: u32,
    sum: [u32; 4],
}

/// Keep one per thread to reuse its buffers.
#[derive(Default)]
pub struct EdgeSamples {
    samples: Vec<EdgeSample>,
    pixels: Vec<EdgePixel>,
    order: SurfaceOrder,
    /// Samples of the current surface.
    positions: Vec<[i32; 2]>,
    colors: Vec<[u16; 3]>,
}

impl EdgeSamples {
    pub fn clear(&mut self) {
        self.samples.clear();
        self.pixels.clear();
    }

    /// Begins a pixel; `at` is its index in the G-buffer.
    #[inline(always)]
    pub fn begin_pixel(&mut self, at: usize) {
        self.pixels.push(EdgePixel { at: at as u32, sum: [0; 4] });
    }

    /// Adds a surface to the pixel that was begun last.
    #[inline(always)]
    pub fn push(&mut self, position: [i32; 2], weight: u32, surface: usize) {
        let pixel = self.pixels.len() - 1;
        self.pixels[pixel].sum[3] += 65_535 * weight;
        self.samples.push(EdgeSample { pixel: pixel as u32, surface: surface as u32, fragment: NO_FRAGMENT, weight, position });
    }

    /// Links the last samples with the fragments from `first` on, of which there are as many.
    pub fn link_fragments(&mut self, first: usize, count: usize) {
        let start = self.samples.len() - count;
        self.samples[start..].iter_mut().zip(first..).for_each(|(sample, k)| sample.fragment = k as u32);
    }

    /// Call it when all samples are there, before `shade`.
    pub fn sort(&mut self, surfaces: usize) {
        self.order.sort(surfaces, self.samples.iter().map(|sample| sample.surface));
    }

    /// Shades the samples of a surface, sets the colours of their fragments, and adds them to their pixels.
    pub fn shade(
        &mut self,
        number: usize,
        surface: &PreparedSurface,
        materials: &mut MaterialCache,
        textures: &TextureCache,
        fragments: &mut [Fragment],
    ) -> Result<()> {
        let numbers = self.order.of(number);
        self.positions.clear();
        self.positions.extend(numbers.iter().map(|number| self.samples[*number as usize].position));
        self.colors.resize(numbers.len(), [0; 3]);
        surface.color.each(&self.positions, &mut self.colors, materials, textures)?;
        for (number, color) in numbers.iter().zip(&self.colors) {
            let EdgeSample { pixel, fragment, weight, .. } = self.samples[*number as usize];
            let sum = &mut self.pixels[pixel as usize].sum;
            (0..3).for_each(|c| sum[c] += u32::from(color[c]) * weight);
            if fragment != NO_FRAGMENT {
                fragments[fragment as usize].color = *color;
            }
        }
        Ok(())
    }

    /// Writes the means over 2^`bits` samples.
    pub fn resolve(&self, bits: u32, color: &mut [[u16; 4]]) {
        for pixel in &self.pixels {
            color[pixel.at as usize] = pixel.sum.map(|c| ((c + (1 << bits >> 1)) >> bits) as u16);
        }
    }
}
