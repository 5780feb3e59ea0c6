//! All layers of a tile as arrays, before encoding (spec/pyramid.md §5).

use map3d_base::DEPTH_NOTHING;

/// Rows top to bottom; all four arrays hold `width · height` entries.
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
}

impl GBuffer {
    /// Nothing anywhere.
    pub fn empty(width: u32, height: u32) -> Self {
        let n = width as usize * height as usize;
        Self { width, height, color: vec![[0; 4]; n], normal: vec![[0; 3]; n], id: vec![0; n], depth: vec![DEPTH_NOTHING; n] }
    }

    /// Back to nothing anywhere, for another tile.
    pub fn clear(&mut self) {
        self.color.fill([0; 4]);
        self.normal.fill([0; 3]);
        self.id.fill(0);
        self.depth.fill(DEPTH_NOTHING);
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
