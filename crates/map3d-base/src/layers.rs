//! The kinds of layers: the table of spec/layers.json (spec/pyramid.md §5 to §7). Python takes it from the compiled core; a test in each language compares it.

use std::marker::PhantomData;

use serde::{Deserialize, Serialize};

use crate::DEPTH_NOTHING;
use crate::limits::MAX_SUNS;

/// The discriminant is the kind's code: its bit in seams, and its byte in block keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LayerKind {
    Color = 0,
    Normal = 1,
    Id = 2,
    Depth = 3,
    Sun = 4,
    Sun16 = 5,
    Ao = 6,
    Depth2 = 7,
    Picture = 8,
    /// Normal, id and depth in one tile.
    Data = 9,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LayerFormat {
    Webp,
    Png,
    Jpeg,
    /// The data tile (spec/data-tile.md).
    M3d,
}

/// Type of a pixel of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum PixelType {
    #[serde(rename = "uint8")]
    U8,
    #[serde(rename = "uint16")]
    U16,
    #[serde(rename = "uint32")]
    U32,
    #[serde(rename = "int16x3")]
    I16x3,
    #[serde(rename = "uint16x4")]
    U16x4,
}

/// How a parent's pixel follows from those of its four children.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reduction {
    /// The mean of each channel.
    Mean,
    /// The mean over the children that have an id.
    MeanOfCovered,
    /// The id that most children have: the parent's id.
    MostFrequent,
    /// The normalised mean over the children with the parent's id.
    MeanDirection,
    /// The least among the children with the parent's id.
    Least,
    /// That of the nearest child with the parent's id.
    Nearest,
}

/// An array of a G-buffer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ArrayRow {
    pub pixel: PixelType,
    /// Each channel of a pixel without a surface.
    pub nothing: u32,
    pub reduction: Reduction,
}

/// What is common to all layers of a kind.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LayerRow {
    pub kind: LayerKind,
    pub code: u8,
    /// `None`: the layer has the arrays of the kinds that it holds.
    pub array: Option<ArrayRow>,
    /// The first is the default.
    pub formats: &'static [LayerFormat],
    /// Least and greatest number of suns.
    pub suns: [usize; 2],
    /// Whether the layer has a radius of ambient occlusion.
    pub radius: bool,
    /// Whether rays from the visible points compute it.
    pub traced: bool,
    /// Whether images of any view have it, too (spec/cameras.md); every kind can be a layer of a pyramid.
    pub view: bool,
    /// Unit of lengths.
    pub unit_m: Option<f64>,
    /// The kinds whose pixels it stores.
    pub holds: &'static [LayerKind],
}

const UNIT_M: f64 = 1.0 / crate::DEPTH_UNITS_PER_M;

/// All kinds, in the order of the layers of a rendering.
pub const LAYERS: [LayerRow; 10] = [
    LayerRow { formats: IMAGE_FORMATS, ..row(LayerKind::Color, PixelType::U16x4, 0, Reduction::Mean) },
    row(LayerKind::Normal, PixelType::I16x3, 0, Reduction::MeanDirection),
    row(LayerKind::Id, PixelType::U32, 0, Reduction::MostFrequent),
    LayerRow { unit_m: Some(UNIT_M), ..row(LayerKind::Depth, PixelType::U32, DEPTH_NOTHING, Reduction::Least) },
    LayerRow {
        kind: LayerKind::Data,
        code: LayerKind::Data as u8,
        array: None,
        formats: &[LayerFormat::M3d],
        suns: [0, 0],
        radius: false,
        traced: false,
        view: false,
        unit_m: Some(UNIT_M),
        holds: &[LayerKind::Normal, LayerKind::Id, LayerKind::Depth],
    },
    LayerRow { suns: [1, 1], traced: true, ..row(LayerKind::Sun, PixelType::U8, 255, Reduction::MeanOfCovered) },
    LayerRow { suns: [1, MAX_SUNS], traced: true, view: false, ..row(LayerKind::Sun16, PixelType::U16, 0, Reduction::Nearest) },
    LayerRow { radius: true, traced: true, ..row(LayerKind::Ao, PixelType::U8, 255, Reduction::MeanOfCovered) },
    LayerRow { traced: true, view: false, unit_m: Some(UNIT_M), ..row(LayerKind::Depth2, PixelType::U32, DEPTH_NOTHING, Reduction::Least) },
    LayerRow { formats: IMAGE_FORMATS, suns: [1, 1], radius: true, traced: true, ..row(LayerKind::Picture, PixelType::U16x4, 0, Reduction::Mean) },
];

const IMAGE_FORMATS: &[LayerFormat] = &[LayerFormat::Webp, LayerFormat::Png, LayerFormat::Jpeg];

/// Returns the row of a PNG layer that shading computes.
const fn row(kind: LayerKind, pixel: PixelType, nothing: u32, reduction: Reduction) -> LayerRow {
    LayerRow {
        kind,
        code: kind as u8,
        array: Some(ArrayRow { pixel, nothing, reduction }),
        formats: &[LayerFormat::Png],
        suns: [0, 0],
        radius: false,
        traced: false,
        view: true,
        unit_m: None,
        holds: &[],
    }
}

impl LayerKind {
    pub const fn row(self) -> &'static LayerRow {
        const TABLE: &[LayerRow; LAYERS.len()] = &LAYERS;
        let mut k = 0;
        while TABLE[k].kind as u8 != self as u8 {
            k += 1;
        }
        &TABLE[k]
    }
}

/// The array of a kind in a G-buffer, with the type of its pixels.
pub struct ArrayKey<T> {
    pub kind: LayerKind,
    pixel: PhantomData<T>,
}

impl<T> Clone for ArrayKey<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for ArrayKey<T> {}

/// A Rust type of pixels.
pub trait Pixel: bytemuck::Pod + PartialEq {
    const TYPE: PixelType;
}

impl Pixel for u8 {
    const TYPE: PixelType = PixelType::U8;
}

impl Pixel for u16 {
    const TYPE: PixelType = PixelType::U16;
}

impl Pixel for u32 {
    const TYPE: PixelType = PixelType::U32;
}

impl Pixel for [i16; 3] {
    const TYPE: PixelType = PixelType::I16x3;
}

impl Pixel for [u16; 4] {
    const TYPE: PixelType = PixelType::U16x4;
}

impl<T: Pixel> ArrayKey<T> {
    /// Stops the compiler for a kind whose pixels are of another type.
    pub const fn new(kind: LayerKind) -> Self {
        match kind.row().array {
            Some(array) => assert!(array.pixel as u8 == T::TYPE as u8, "the kind's pixels are of another type"),
            None => panic!("the kind has no array of its own"),
        }
        Self { kind, pixel: PhantomData }
    }
}

pub const COLOR: ArrayKey<[u16; 4]> = ArrayKey::new(LayerKind::Color);
pub const NORMAL: ArrayKey<[i16; 3]> = ArrayKey::new(LayerKind::Normal);
pub const ID: ArrayKey<u32> = ArrayKey::new(LayerKind::Id);
pub const DEPTH: ArrayKey<u32> = ArrayKey::new(LayerKind::Depth);
pub const SUN: ArrayKey<u8> = ArrayKey::new(LayerKind::Sun);
pub const SUN16: ArrayKey<u16> = ArrayKey::new(LayerKind::Sun16);
pub const AO: ArrayKey<u8> = ArrayKey::new(LayerKind::Ao);
pub const DEPTH2: ArrayKey<u32> = ArrayKey::new(LayerKind::Depth2);
pub const PICTURE: ArrayKey<[u16; 4]> = ArrayKey::new(LayerKind::Picture);
