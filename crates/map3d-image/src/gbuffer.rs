//! All layers of a tile as arrays, before encoding (spec/pyramid.md §5).

use std::array;
use std::ops::{Index, IndexMut};

use map3d_base::layers::{ArrayKey, COLOR, ID, LAYERS};
use map3d_base::{LayerKind, LayerSpec};

use crate::pixel_array::{ArrayPixel, PixelArray};

/// A set of arrays. That of a G-buffer always contains id and depth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arrays(u32);

impl Arrays {
    /// No arrays.
    pub const NONE: Self = Self(0);
    /// Id and depth.
    pub const LEAST: Self = Self::NONE.and(LayerKind::Id).and(LayerKind::Depth);
    /// The arrays of a rendering without further layers.
    pub const STANDARD: Self = Self::LEAST.and(LayerKind::Color).and(LayerKind::Normal);

    /// Returns the arrays of a pass of these layers; `STANDARD` for none.
    pub fn of(layers: &[LayerSpec]) -> Self {
        if layers.is_empty() { Self::STANDARD } else { layers.iter().fold(Self::LEAST, |all, l| all.and(l.kind)) }
    }

    /// Adds the arrays of a kind of layer: its own, or those of the kinds that it holds.
    pub const fn and(self, kind: LayerKind) -> Self {
        let row = kind.row();
        let mut bits = if row.array.is_some() { self.0 | 1 << row.code } else { self.0 };
        let mut k = 0;
        while k < row.holds.len() {
            bits |= 1 << row.holds[k] as u32;
            k += 1;
        }
        Self(bits)
    }

    pub const fn has(self, kind: LayerKind) -> bool {
        self.0 >> kind as u32 & 1 == 1
    }

    /// Bit k: the array of the kind with code k.
    pub const fn bits(self) -> u32 {
        self.0
    }

    /// Returns `None` for unknown bits, or without id and depth.
    pub fn from_bits(bits: u32) -> Option<Self> {
        let all = LAYERS.iter().fold(Self::NONE, |all, row| all.and(row.kind));
        (bits & !all.0 == 0 && bits & Self::LEAST.0 == Self::LEAST.0).then_some(Self(bits))
    }
}

/// The layers of a tile. Rows top to bottom; an array has `width · height` pixels, or none when the G-buffer lacks it. `g[ID]` is the array of ids.
///
/// * color, picture: linear light R, G, B premultiplied by coverage, then coverage; 65535 = 1.
/// * normal: unit normal × 32767, local axes, of the visible side.
/// * depth, depth2: units of 2^-10 m from D0.
/// * sun, ao: 255 is lit, unoccluded. sun16: bit k is set where sun k lights.
///
/// The table of spec/layers.json has their types and the values where nothing is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GBuffer {
    pub width: u32,
    pub height: u32,
    /// By the codes of their kinds.
    all: [PixelArray; LAYERS.len()],
}

/// The arrays that shading fills.
pub struct SurfaceArrays<'a> {
    pub color: &'a mut [[u16; 4]],
    pub normal: &'a mut [[i16; 3]],
    pub id: &'a mut [u32],
    pub depth: &'a mut [u32],
}

impl GBuffer {
    /// Returns an empty G-buffer with the standard arrays.
    pub fn empty(width: u32, height: u32) -> Self {
        Self::with(width, height, Arrays::STANDARD)
    }

    /// Returns an empty G-buffer.
    pub fn with(width: u32, height: u32, arrays: Arrays) -> Self {
        let mut all = array::from_fn(|_| PixelArray::U8(Vec::new()));
        for row in &LAYERS {
            if let Some(array) = row.array {
                let count = if arrays.has(row.kind) { width as usize * height as usize } else { 0 };
                all[usize::from(row.code)] = PixelArray::new(array.pixel, array.nothing, count);
            }
        }
        Self { width, height, all }
    }

    /// Returns the arrays that are present.
    pub fn arrays(&self) -> Arrays {
        let bits = self.all.iter().zip(0..).map(|(array, code)| u32::from(!array.is_empty()) << code);
        Arrays(bits.fold(Arrays::LEAST.0, |all, bit| all | bit))
    }

    /// Returns all arrays with their codes; those that are absent have no pixels.
    pub fn by_code(&self) -> &[PixelArray] {
        &self.all
    }

    pub fn by_code_mut(&mut self) -> &mut [PixelArray] {
        &mut self.all
    }

    /// Returns the arrays that are present, by kind.
    pub fn into_arrays(self) -> impl Iterator<Item = (LayerKind, PixelArray)> {
        let kind = |code: usize| LAYERS.iter().find(|row| usize::from(row.code) == code).expect("each code has a row").kind;
        self.all.into_iter().enumerate().filter(|(_, array)| !array.is_empty()).map(move |(code, array)| (kind(code), array))
    }

    pub fn surface_arrays(&mut self) -> SurfaceArrays<'_> {
        let kinds = [LayerKind::Color, LayerKind::Normal, LayerKind::Id, LayerKind::Depth];
        let [color, normal, id, depth] = self.all.get_disjoint_mut(kinds.map(|kind| kind as usize)).expect("four kinds");
        SurfaceArrays {
            color: ArrayPixel::slice_mut(color),
            normal: ArrayPixel::slice_mut(normal),
            id: ArrayPixel::slice_mut(id),
            depth: ArrayPixel::slice_mut(depth),
        }
    }

    /// Drops all other arrays; id and depth stay.
    pub fn keep(&mut self, arrays: Arrays) {
        let kept = arrays.0 | Arrays::LEAST.0;
        self.all.iter_mut().zip(0..).filter(|(_, code)| kept >> code & 1 == 0).for_each(|(array, _)| array.clear());
    }

    /// Whether no pixel has coverage or an id.
    pub fn is_empty(&self) -> bool {
        self[ID].iter().all(|id| *id == 0) && self[COLOR].iter().all(|c| c[3] == 0)
    }
}

impl<T: ArrayPixel> Index<ArrayKey<T>> for GBuffer {
    type Output = [T];

    #[inline(always)]
    fn index(&self, key: ArrayKey<T>) -> &[T] {
        T::slice(&self.all[key.kind as usize])
    }
}

impl<T: ArrayPixel> IndexMut<ArrayKey<T>> for GBuffer {
    #[inline(always)]
    fn index_mut(&mut self, key: ArrayKey<T>) -> &mut [T] {
        T::slice_mut(&mut self.all[key.kind as usize])
    }
}

/// Converts a vector of any length to a stored normal; `None` for a vector without a direction.
pub fn normal_from_vector(n: [f64; 3]) -> Option<[i16; 3]> {
    let unit = map3d_base::vec3::normalized(n)?;
    Some(unit.map(|c| (c * 32_767.0).round() as i16))
}
