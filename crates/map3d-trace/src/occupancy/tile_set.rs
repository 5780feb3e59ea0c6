//! The marked tiles of one level in a sparse quadtree: memory grows with the marked tiles, not with the level.

use map3d_base::tile::morton;

/// The leaves of the quadtree are pages of 8 × 8 tiles, one bit each, in Morton order.
const PAGE_LEVELS: u8 = 3;
/// A quadrant without marked tiles.
const EMPTY: u32 = u32::MAX - 1;
/// A quadrant whose tiles are all marked.
const FULL: u32 = u32::MAX;

const UP_TO_COLUMN: [u64; 8] = bits_up_to(0);
const UP_TO_ROW: [u64; 8] = bits_up_to(1);

/// The bits of a page up to and including each column (axis 0) or row (axis 1).
const fn bits_up_to(axis: u32) -> [u64; 8] {
    let mut out = [0; 8];
    let mut bit = 0;
    while bit < 64 {
        let mut line = (bit >> axis & 1) | (bit >> (axis + 2) & 1) << 1 | (bit >> (axis + 4) & 1) << 2;
        while line < 8 {
            out[line as usize] |= 1 << bit;
            line += 1;
        }
        bit += 1;
    }
    out
}

/// First and last column, first and last row, all included.
#[derive(Clone, Copy, Debug)]
pub(super) struct TileRange {
    pub x: [u32; 2],
    pub y: [u32; 2],
}

impl TileRange {
    fn meets(&self, other: &Self) -> bool {
        self.x[0] <= other.x[1] && self.x[1] >= other.x[0] && self.y[0] <= other.y[1] && self.y[1] >= other.y[0]
    }

    fn intersection(&self, other: &Self) -> Self {
        let common = |a: [u32; 2], b: [u32; 2]| [a[0].max(b[0]), a[1].min(b[1])];
        Self { x: common(self.x, other.x), y: common(self.y, other.y) }
    }
}

/// A square of the quadtree by its top left tile; height 0 is a page.
#[derive(Clone, Copy)]
struct Square {
    height: u8,
    x: u32,
    y: u32,
}

impl Square {
    fn range(self) -> TileRange {
        let last = (1 << (self.height + PAGE_LEVELS)) - 1;
        TileRange { x: [self.x, self.x + last], y: [self.y, self.y + last] }
    }

    fn quadrant(self, k: usize) -> Self {
        let side = 1 << (self.height - 1 + PAGE_LEVELS);
        Self { height: self.height - 1, x: self.x + (k as u32 & 1) * side, y: self.y + (k as u32 >> 1) * side }
    }

    /// The quadrant that holds a whole range, if one does.
    fn quadrant_around(self, range: &TileRange) -> Option<usize> {
        let bit = self.height - 1 + PAGE_LEVELS;
        let inside = (range.x[0] ^ range.x[1]) >> bit == 0 && (range.y[0] ^ range.y[1]) >> bit == 0;
        inside.then_some((range.x[0] >> bit & 1 | (range.y[0] >> bit & 1) << 1) as usize)
    }

    /// The bits of a page whose tiles are in a range.
    fn bits(self, range: &TileRange) -> u64 {
        let local = range.intersection(&self.range());
        let line = |table: &[u64; 8], [first, last]: [u32; 2], start: u32| {
            let before = if first == start { 0 } else { table[(first - start - 1) as usize] };
            table[(last - start) as usize] & !before
        };
        line(&UP_TO_COLUMN, local.x, self.x) & line(&UP_TO_ROW, local.y, self.y)
    }

    fn tile(self, bit: u32) -> TileRange {
        let line = |b: u32| (b & 1) | (b >> 2 & 1) << 1 | (b >> 4 & 1) << 2;
        let (x, y) = (self.x + line(bit), self.y + line(bit >> 1));
        TileRange { x: [x, x], y: [y, y] }
    }
}

/// Tiles of one level, of which only those in some blocks of a level above can be marked.
pub(super) struct TileSet {
    level: u8,
    block_level: u8,
    /// Morton numbers, sorted, each once.
    blocks: Vec<u64>,
    root: u32,
    nodes: Vec<[u32; 4]>,
    pages: Vec<u64>,
}

impl TileSet {
    /// No tile is marked. The blocks, (x, y) each, exist at `block_level` ≤ `level`.
    pub fn new(level: u8, block_level: u8, blocks: &[[u32; 2]]) -> Self {
        let mut numbers: Vec<u64> = blocks.iter().map(|[x, y]| morton(*x, *y)).collect();
        numbers.sort_unstable();
        numbers.dedup();
        let mut set = Self { level, block_level, blocks: Vec::new(), root: EMPTY, nodes: Vec::new(), pages: Vec::new() };
        set.root = set.close_outside(set.height(), 0, &numbers);
        set.blocks = numbers;
        set
    }

    /// Tiles of a side of the level.
    pub fn side(&self) -> u32 {
        1 << self.level
    }

    /// Whether a tile of the range, which lies in the level, can still be marked.
    pub fn has_unmarked(&self, range: &TileRange) -> bool {
        // Go down to the smallest square around the range.
        let (mut square, mut child) = (self.square(), self.root);
        while square.height > 0 && child < EMPTY {
            let Some(k) = square.quadrant_around(range) else { break };
            child = self.nodes[child as usize][k];
            square = square.quadrant(k);
        }
        self.has_unmarked_in(child, square, range)
    }

    fn has_unmarked_in(&self, child: u32, square: Square, range: &TileRange) -> bool {
        match child {
            FULL => false,
            EMPTY => true,
            page if square.height == 0 => square.bits(range) & !self.pages[page as usize] != 0,
            node => (0..4).any(|k| {
                let quadrant = square.quadrant(k);
                quadrant.range().meets(range) && self.has_unmarked_in(self.nodes[node as usize][k], quadrant, range)
            }),
        }
    }

    /// Marks the tiles of a range that `meets` accepts. If it rejects a range, it rejects every part of it.
    pub fn mark(&mut self, range: &TileRange, meets: impl Fn(&TileRange) -> bool) {
        self.root = self.mark_in(self.root, self.square(), range, &meets);
    }

    fn mark_in(&mut self, child: u32, square: Square, range: &TileRange, meets: &impl Fn(&TileRange) -> bool) -> u32 {
        if child == FULL {
            return FULL;
        }
        if square.height == 0 {
            return self.mark_page(child, square, range, meets);
        }
        let mut quadrants = if child == EMPTY { [EMPTY; 4] } else { self.nodes[child as usize] };
        if let Some(k) = square.quadrant_around(range) {
            quadrants[k] = self.mark_in(quadrants[k], square.quadrant(k), range, meets);
        } else {
            for k in 0..4 {
                let quadrant = square.quadrant(k);
                if quadrant.range().meets(range) && meets(&quadrant.range().intersection(range)) {
                    quadrants[k] = self.mark_in(quadrants[k], quadrant, range, meets);
                }
            }
        }
        self.keep_node(child, quadrants)
    }

    fn mark_page(&mut self, child: u32, square: Square, range: &TileRange, meets: &impl Fn(&TileRange) -> bool) -> u32 {
        let before = if child == EMPTY { 0 } else { self.pages[child as usize] };
        let (mut open, mut page) = (square.bits(range) & !before, before);
        while open != 0 {
            let bit = open.trailing_zeros();
            open &= open - 1;
            page |= u64::from(meets(&square.tile(bit))) << bit;
        }
        self.keep_page(child, page)
    }

    fn keep_node(&mut self, child: u32, quadrants: [u32; 4]) -> u32 {
        if quadrants[0] >= EMPTY && quadrants == [quadrants[0]; 4] {
            return quadrants[0];
        }
        keep(&mut self.nodes, child, quadrants)
    }

    fn keep_page(&mut self, child: u32, page: u64) -> u32 {
        match page {
            0 => EMPTY,
            u64::MAX => FULL,
            _ => keep(&mut self.pages, child, page),
        }
    }

    /// A square by its height and Morton number in which everything except the blocks is marked. `blocks`: those in the square.
    fn close_outside(&mut self, height: u8, number: u64, blocks: &[u64]) -> u32 {
        if blocks.is_empty() {
            return FULL;
        }
        if self.is_block(height) {
            return EMPTY;
        }
        if height == 0 {
            let inside = self.bits_of(blocks);
            return self.keep_page(EMPTY, !inside);
        }
        let quadrants = [0, 1, 2, 3].map(|k| self.close_outside(height - 1, 4 * number + k, self.blocks_in(height - 1, 4 * number + k, blocks)));
        self.keep_node(EMPTY, quadrants)
    }

    /// Morton numbers of the marked tiles, sorted.
    pub fn numbers(&self) -> Vec<u64> {
        let mut out = Vec::new();
        self.collect(self.root, self.height(), 0, &self.blocks, &mut out);
        out
    }

    fn collect(&self, child: u32, height: u8, number: u64, blocks: &[u64], out: &mut Vec<u64>) {
        if child == EMPTY || blocks.is_empty() {
            return;
        }
        if height == 0 {
            let page = if child == FULL { u64::MAX } else { self.pages[child as usize] };
            let mut marked = page & self.bits_of(blocks);
            while marked != 0 {
                out.push(number << (2 * PAGE_LEVELS) | u64::from(marked.trailing_zeros()));
                marked &= marked - 1;
            }
            return;
        }
        for k in 0..4 {
            let quadrant = if child == FULL { FULL } else { self.nodes[child as usize][k as usize] };
            let inside = self.blocks_in(height - 1, 4 * number + k, blocks);
            self.collect(quadrant, height - 1, 4 * number + k, inside, out);
        }
    }

    fn height(&self) -> u8 {
        self.level.saturating_sub(PAGE_LEVELS)
    }

    fn square(&self) -> Square {
        Square { height: self.height(), x: 0, y: 0 }
    }

    /// Whether squares of a height are blocks, or parts of one.
    fn is_block(&self, height: u8) -> bool {
        self.level.saturating_sub(height + PAGE_LEVELS) >= self.block_level
    }

    /// Those of the blocks that meet the square of a height and Morton number.
    fn blocks_in<'a>(&self, height: u8, number: u64, blocks: &'a [u64]) -> &'a [u64] {
        if self.is_block(height) {
            // The square lies in one block.
            let up = 2 * (self.level - height - PAGE_LEVELS - self.block_level);
            let at = blocks.binary_search(&(number >> up));
            return at.map_or(&[], |k| &blocks[k..=k]);
        }
        let down = 2 * (self.block_level + height + PAGE_LEVELS - self.level);
        let [first, end] = [number, number + 1].map(|n| blocks.partition_point(|b| *b < n << down));
        &blocks[first..end]
    }

    /// The bits of the page that the blocks meet.
    fn bits_of(&self, blocks: &[u64]) -> u64 {
        let down = self.level - self.block_level;
        if down >= PAGE_LEVELS {
            return u64::MAX;
        }
        let tiles = 1 << (2 * down);
        blocks.iter().fold(0, |bits, b| bits | ((1u64 << tiles) - 1) << (b * tiles % 64))
    }
}

/// Stores an item at `place`, or at a new one when `place` is empty; returns where.
fn keep<T>(items: &mut Vec<T>, place: u32, item: T) -> u32 {
    if place == EMPTY {
        items.push(item);
        return items.len() as u32 - 1;
    }
    items[place as usize] = item;
    place
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Seeded numbers below a bound (splitmix64).
    struct Dice(u64);

    impl Dice {
        fn below(&mut self, bound: u32) -> u32 {
            self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            let z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
            ((z ^ z >> 31) % u64::from(bound)) as u32
        }

        fn line(&mut self, side: u32, most: u32) -> [u32; 2] {
            let first = self.below(side);
            [first, (first + self.below(most)).min(side - 1)]
        }
    }

    fn tiles(range: &TileRange) -> impl Iterator<Item = [u32; 2]> + use<> {
        let ([x0, x1], [y0, y1]) = (range.x, range.y);
        (y0..=y1).flat_map(move |y| (x0..=x1).map(move |x| [x, y]))
    }

    /// Marks random ranges in a tile set and in a plain set of tiles, and compares after each.
    fn compare_with_plain_set(level: u8, block_level: u8, blocks: &[[u32; 2]], seed: u64) {
        let (side, mut dice) = (1u32 << level, Dice(seed));
        let is_open = |t: &[u32; 2]| blocks.contains(&t.map(|v| v >> (level - block_level)));
        let (mut set, mut plain) = (TileSet::new(level, block_level, blocks), BTreeSet::new());
        for _ in 0..60 {
            let most = if dice.below(4) == 0 { side } else { 5 };
            let range = TileRange { x: dice.line(side, most), y: dice.line(side, most) };
            let is_unmarked = tiles(&range).any(|t| is_open(&t) && !plain.contains(&morton(t[0], t[1])));
            assert_eq!(set.has_unmarked(&range), is_unmarked, "level {level} {range:?}");
            // Only tiles on one side of a diagonal, as with a triangle's edge.
            let sum = dice.below(2 * side);
            set.mark(&range, |part| part.x[0] + part.y[0] <= sum);
            plain.extend(tiles(&range).filter(|t| is_open(t) && t[0] + t[1] <= sum).map(|[x, y]| morton(x, y)));
            assert_eq!(set.numbers(), plain.iter().copied().collect::<Vec<_>>(), "level {level} {range:?}");
        }
    }

    #[test]
    fn a_tile_set_equals_a_plain_set_of_tiles() {
        for level in 0..=7 {
            (0..8).for_each(|seed| compare_with_plain_set(level, 0, &[[0, 0]], seed));
        }
    }

    #[test]
    fn only_tiles_of_the_given_blocks_are_marked() {
        for level in 0..=6 {
            for block_level in 0..=level {
                let mut dice = Dice(u64::from(level * 7 + block_level));
                let count = dice.below(6);
                let blocks: Vec<[u32; 2]> = (0..count).map(|_| [dice.below(1 << block_level), dice.below(1 << block_level)]).collect();
                compare_with_plain_set(level, block_level, &blocks, 5);
            }
        }
    }

    #[test]
    fn memory_grows_with_marked_tiles_at_the_deepest_level() {
        let mut set = TileSet::new(26, 0, &[[0, 0]]);
        let last = set.side() - 1;
        for k in 0..1000 {
            let range = TileRange { x: [k * 67_000; 2], y: [last - k * 67_000; 2] };
            set.mark(&range, |_| true);
            assert!(!set.has_unmarked(&range));
        }
        assert_eq!(set.numbers().len(), 1000);
        assert!(set.nodes.len() < 23_000 && set.pages.len() == 1000);
        assert!(set.has_unmarked(&TileRange { x: [0, last], y: [0, last] }));
    }

    #[test]
    fn a_full_square_needs_no_pages() {
        let mut set = TileSet::new(9, 0, &[[0, 0]]);
        for y in 0..512 {
            set.mark(&TileRange { x: [0, 511], y: [y, y] }, |_| true);
        }
        assert_eq!(set.root, FULL);
        assert_eq!(set.numbers(), (0..1 << 18).collect::<Vec<_>>());
    }
}
