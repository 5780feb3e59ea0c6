//! All layers of a tile as arrays, before encoding (spec/pyramid.md §5).

use map3d_base::{DEPTH_NOTHING, LayerKind, LayerSpec};

/// A set of arrays. That of a G-buffer always contains id and depth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arrays(u32);

impl Arrays {
    /// No arrays.
    pub const NONE: Self = Self(0);
    /// Id and depth.
    pub const LEAST: Self = Self(1 << LayerKind::Id as u32 | 1 << LayerKind::Depth as u32);
    /// The arrays of a rendering without further layers.
    pub const STANDARD: Self = Self::LEAST.and(LayerKind::Color).and(LayerKind::Normal);

    /// Returns the arrays of a pass of these layers; `STANDARD` for none.
    pub fn of(layers: &[LayerSpec]) -> Self {
        if layers.is_empty() { Self::STANDARD } else { layers.iter().fold(Self::LEAST, |all, l| all.and(l.kind)) }
    }

    /// Adds the arrays of a kind of layer.
    pub const fn and(self, kind: LayerKind) -> Self {
        match kind {
            LayerKind::Data => Self(self.0 | Self::LEAST.0 | 1 << LayerKind::Normal as u32),
            _ => Self(self.0 | 1 << kind as u32),
        }
    }

    pub const fn has(self, kind: LayerKind) -> bool {
        self.0 >> kind as u32 & 1 == 1
    }

    /// Bit k: the array of row k of spec/pyramid.md §5.
    pub const fn bits(self) -> u32 {
        self.0
    }

    /// Returns `None` for unknown bits, or without id and depth.
    pub fn from_bits(bits: u32) -> Option<Self> {
        (bits >> (LayerKind::Picture as u32 + 1) == 0 && bits & Self::LEAST.0 == Self::LEAST.0).then_some(Self(bits))
    }
}

/// The layers of a tile. Rows top to bottom; an array has `width · height` entries, or none when the G-buffer lacks it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GBuffer {
    pub width: u32,
    pub height: u32,
    /// Linear light R, G, B premultiplied by coverage, then coverage; 65535 = 1.
    pub color: Vec<[u16; 4]>,
    /// Unit normal × 32767, local axes, of the visible side; 0, 0, 0: nothing.
    pub normal: Vec<[i16; 3]>,
    /// 0: nothing.
    pub id: Vec<u32>,
    /// Units of 2^-10 m from D0; `DEPTH_NOTHING`: nothing.
    pub depth: Vec<u32>,
    /// 255: lit, or nothing.
    pub sun: Vec<u8>,
    /// Bit k: lit by sun k.
    pub sun16: Vec<u16>,
    /// 255: unoccluded, or nothing.
    pub ao: Vec<u8>,
    /// Like depth, of the second surface.
    pub depth2: Vec<u32>,
    /// Like color, lit.
    pub picture: Vec<[u16; 4]>,
}

impl GBuffer {
    /// Returns an empty G-buffer with the standard arrays.
    pub fn empty(width: u32, height: u32) -> Self {
        Self::with(width, height, Arrays::STANDARD)
    }

    /// Returns an empty G-buffer.
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

    /// Returns the arrays that are present.
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

    /// Drops all other arrays.
    pub fn keep(&mut self, arrays: Arrays) {
        let Self { color, normal, sun, sun16, ao, depth2, picture, .. } = self;
        let is_dropped = |kind| !arrays.has(kind);
        is_dropped(LayerKind::Color).then(|| *color = Vec::new());
        is_dropped(LayerKind::Normal).then(|| *normal = Vec::new());
        is_dropped(LayerKind::Sun).then(|| *sun = Vec::new());
        is_dropped(LayerKind::Sun16).then(|| *sun16 = Vec::new());
        is_dropped(LayerKind::Ao).then(|| *ao = Vec::new());
        is_dropped(LayerKind::Depth2).then(|| *depth2 = Vec::new());
        is_dropped(LayerKind::Picture).then(|| *picture = Vec::new());
    }

    /// Whether no pixel has coverage or an id.
    pub fn is_empty(&self) -> bool {
        self.id.iter().all(|id| *id == 0) && self.color.iter().all(|c| c[3] == 0)
    }
}

/// Converts a vector of any length to a stored normal; `None` for a vector without a direction.
pub fn normal_from_vector(n: [f64; 3]) -> Option<[i16; 3]> {
    let unit = map3d_base::vec3::normalized(n)?;
    Some(unit.map(|c| (c * 32_767.0).round() as i16))
}
