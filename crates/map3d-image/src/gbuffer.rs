//! All layers of a tile as arrays, before encoding (spec/pyramid.md §5).

use map3d_base::{DEPTH_NOTHING, LayerKind, LayerSpec};

/// Which arrays a G-buffer has. id and depth are always among them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arrays(u32);

impl Arrays {
    /// Id and depth.
    pub const LEAST: Self = Self(1 << LayerKind::Id as u32 | 1 << LayerKind::Depth as u32);
    /// Those of a rendering without further layers.
    pub const STANDARD: Self = Self::LEAST.and(LayerKind::Color).and(LayerKind::Normal);

    /// What a pass of these layers keeps; `STANDARD` without any.
    pub fn of(layers: &[LayerSpec]) -> Self {
        if layers.is_empty() { Self::STANDARD } else { layers.iter().fold(Self::LEAST, |all, l| all.and(l.kind)) }
    }

    /// With one more.
    pub const fn and(self, kind: LayerKind) -> Self {
        Self(self.0 | 1 << kind as u32)
    }

    pub const fn has(self, kind: LayerKind) -> bool {
        self.0 >> kind as u32 & 1 == 1
    }

    /// Bit k: the array of row k of spec/pyramid.md §5.
    pub const fn bits(self) -> u32 {
        self.0
    }

    /// `None`: bits without a meaning, or without id and depth.
    pub fn from_bits(bits: u32) -> Option<Self> {
        (bits >> (LayerKind::Picture as u32 + 1) == 0 && bits & Self::LEAST.0 == Self::LEAST.0).then_some(Self(bits))
    }
}

/// Rows top to bottom; all arrays hold `width · height` entries, or none where the G-buffer does not have them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GBuffer {
    pub width: u32,
    pub height: u32,
    /// Linear light R, G, B premultiplied by coverage, then coverage; 65535 = 1.
    pub color: Vec<[u16; 4]>,
    /// Unit normal × 32767, local axes, of the side that is seen; 0, 0, 0: nothing.
    pub normal: Vec<[i16; 3]>,
    /// 0: nothing.
    pub id: Vec<u32>,
    /// Units of 2^-10 m from D0; `DEPTH_NOTHING`: nothing.
    pub depth: Vec<u32>,
    /// 255: lit, or nothing there.
    pub sun: Vec<u8>,
    /// Bit k: lit by sun k.
    pub sun16: Vec<u16>,
    /// 255: open, or nothing there.
    pub ao: Vec<u8>,
    /// As depth, of the second surface.
    pub depth2: Vec<u32>,
    /// As color, lit.
    pub picture: Vec<[u16; 4]>,
}

impl GBuffer {
    /// Nothing anywhere, with the standard arrays.
    pub fn empty(width: u32, height: u32) -> Self {
        Self::with(width, height, Arrays::STANDARD)
    }

    /// Nothing anywhere.
    pub fn with(width: u32, height: u32, arrays: Arrays) -> Self {
        let count = |kind| if arrays.has(kind) { width as usize * height as usize } else { 0 };
        Self {
            width,
            height,
            color: vec![[0; 4]; count(LayerKind::Color)],
            normal: vec![[0; 3]; count(LayerKind::Normal)],
            id: vec![0; count(LayerKind::Id)],
            depth: vec![DEPTH_NOTHING; count(LayerKind::Depth)],
            sun: vec![255; count(LayerKind::Sun)],
            sun16: vec![0; count(LayerKind::Sun16)],
            ao: vec![255; count(LayerKind::Ao)],
            depth2: vec![DEPTH_NOTHING; count(LayerKind::Depth2)],
            picture: vec![[0; 4]; count(LayerKind::Picture)],
        }
    }

    /// The arrays that are there.
    pub fn arrays(&self) -> Arrays {
        let there = [
            (LayerKind::Color, self.color.len()),
            (LayerKind::Normal, self.normal.len()),
            (LayerKind::Sun, self.sun.len()),
            (LayerKind::Sun16, self.sun16.len()),
            (LayerKind::Ao, self.ao.len()),
            (LayerKind::Depth2, self.depth2.len()),
            (LayerKind::Picture, self.picture.len()),
        ];
        there.into_iter().filter(|(_, n)| *n > 0).fold(Arrays::LEAST, |all, (kind, _)| all.and(kind))
    }

    /// Lets go of arrays that are not among these.
    pub fn keep(&mut self, arrays: Arrays) {
        let Self { color, normal, sun, sun16, ao, depth2, picture, .. } = self;
        let gone = |kind| !arrays.has(kind);
        gone(LayerKind::Color).then(|| *color = Vec::new());
        gone(LayerKind::Normal).then(|| *normal = Vec::new());
        gone(LayerKind::Sun).then(|| *sun = Vec::new());
        gone(LayerKind::Sun16).then(|| *sun16 = Vec::new());
        gone(LayerKind::Ao).then(|| *ao = Vec::new());
        gone(LayerKind::Depth2).then(|| *depth2 = Vec::new());
        gone(LayerKind::Picture).then(|| *picture = Vec::new());
    }

    /// No pixel has any coverage or id.
    pub fn is_empty(&self) -> bool {
        self.id.iter().all(|id| *id == 0) && self.color.iter().all(|c| c[3] == 0)
    }
}

/// A stored normal of a vector of any length; `None` for one without a direction.
pub fn normal_from_vector(n: [f64; 3]) -> Option<[i16; 3]> {
    let unit = map3d_base::vec3::normalized(n)?;
    Some(unit.map(|c| (c * 32_767.0).round() as i16))
}
