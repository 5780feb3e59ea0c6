//! Names of tiles and blocks (spec/pyramid.md §3, §8).

/// Levels between a base block's root and zmax.
pub const BLOCK_DEPTH: u8 = 3;

/// A tile: level, column (with U), row (downward).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Tile {
    pub z: u8,
    pub x: u32,
    pub y: u32,
}

impl Tile {
    pub fn parent(self) -> Option<Self> {
        (self.z > 0).then(|| Self { z: self.z - 1, x: self.x / 2, y: self.y / 2 })
    }

    /// Children in the order TL, TR, BL, BR.
    pub fn children(self) -> [Self; 4] {
        [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| Self { z: self.z + 1, x: 2 * self.x + dx, y: 2 * self.y + dy })
    }
}

/// Returns the Morton number of (x, y): x in the even bits.
pub fn morton(x: u32, y: u32) -> u64 {
    spread(x) | spread(y) << 1
}

fn spread(v: u32) -> u64 {
    (0..32).fold(0, |acc, bit| acc | (u64::from(v) >> bit & 1) << (2 * bit))
}

/// Returns (root level, number of levels) of a pyramid's blocks, deepest first: the base blocks, then the reduce blocks.
pub fn block_levels(zmax: u8) -> Vec<(u8, u8)> {
    let mut root = zmax.saturating_sub(BLOCK_DEPTH);
    let mut steps = vec![(root, zmax - root + 1)];
    while root > 0 {
        let above = root.saturating_sub(BLOCK_DEPTH);
        steps.push((above, root - above));
        root = above;
    }
    steps
}
