//! Which tiles can have content, decided from boxes and never leaving out what can be seen.

mod keys;
mod reach;

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use map3d_base::{Box3, Error, Frame, Result, Vec3, ViewAxes};
use map3d_scene::instances::{place, placed_box};
use map3d_scene::records::{EMPTY, LEAF_BIT};
use map3d_scene::{LazyChunk, Leaf, ScenePart, SceneStore};

pub use keys::{block_key, block_keys};

/// Beyond this the flags would not fit memory.
const MAX_FLAGS_LEVEL: u8 = 14;
/// Boxes up to this part of a tile are not looked into.
const SMALL_TILES: f64 = 0.25;

/// Row-major flags of the 2^level × 2^level tiles of a level: false only where there is nothing.
pub fn occupied(scene: &SceneStore, frame: &Frame, level: u8) -> Result<Vec<bool>> {
    let mut flags = Flags::new(frame, level, false)?;
    flags.mark(scene, frame, level)?;
    Ok(flags.flags)
}

/// The same within some blocks of a level above, (x, y) each; false outside of them, where nothing is looked at.
pub fn occupied_within(scene: &SceneStore, frame: &Frame, level: u8, block_level: u8, blocks: &[[u32; 2]]) -> Result<Vec<bool>> {
    let mut flags = Flags::new(frame, level, true)?;
    if block_level > level || blocks.iter().flatten().any(|v| v >> block_level != 0) {
        return Err(Error::argument(format!("occupancy: a block of level {block_level} does not exist, or lies below level {level}")));
    }
    let (down, side) = (level - block_level, flags.side);
    let mut inside = vec![false; flags.flags.len()];
    for [x, y] in blocks {
        let (x0, y0, count) = ((*x as usize) << down, (*y as usize) << down, 1usize << down);
        (y0..y0 + count).for_each(|y| inside[y * side + x0..][..count].fill(true));
    }
    flags.flags.iter_mut().zip(&inside).for_each(|(f, i)| *f = !i);
    flags.mark(scene, frame, level)?;
    Ok(flags.flags.iter().zip(&inside).map(|(f, i)| *f && *i).collect())
}

/// The outlines of prototypes stay open, since many instances ask for them; a chunk is asked for once.
#[derive(Default)]
struct Outlines {
    prototypes: HashMap<u32, LazyChunk>,
    chunk: Option<LazyChunk>,
}

impl Outlines {
    fn get(&mut self, scene: &SceneStore, part: &ScenePart) -> Result<&LazyChunk> {
        if part.instance.is_none() {
            return Ok(self.chunk.insert(scene.open_lazily(part.chunk)?));
        }
        Ok(match self.prototypes.entry(part.chunk) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(free) => free.insert(scene.open_lazily(part.chunk)?),
        })
    }
}

fn descend(chunk: &LazyChunk, transform: Option<&[f64; 12]>, view: &TileView, flags: &mut Flags) -> Result<()> {
    let origin = chunk.origin();
    let mut stack = vec![0u32];
    while let Some(child) = stack.pop() {
        if child & LEAF_BIT != 0 {
            mark_leaf(chunk.leaf(child & !LEAF_BIT)?, origin, transform, view, flags);
            continue;
        }
        let node = chunk.node(child)?;
        for k in (0..8).filter(|k| node.child[*k] != EMPTY) {
            let b = [0, 1, 2, 3, 4, 5].map(|a| origin[a % 3] + f64::from(node.bounds[a][k]));
            let bounds = Box3 { lo: [b[0], b[1], b[2]], hi: [b[3], b[4], b[5]] };
            let rect = view.rect(&transform.map_or(bounds, |t| placed_box(t, &bounds)));
            if !flags.has_unset(&rect) {
                continue;
            }
            if rect.is_small() {
                flags.set(&rect);
            } else {
                stack.push(node.child[k]);
            }
        }
    }
    Ok(())
}

fn mark_leaf(leaf: &Leaf, origin: Vec3, transform: Option<&[f64; 12]>, view: &TileView, flags: &mut Flags) {
    for lane in (0..8).take_while(|l| leaf.triangle[*l] != EMPTY) {
        let corners = [0, 3, 6].map(|c| {
            let p = [0, 1, 2].map(|k| origin[k] + f64::from(leaf.corners[c + k][lane]));
            view.tiles(transform.map_or(p, |t| place(t, p)))
        });
        flags.set_triangle(&corners, view.room);
    }
}

/// Local points in tiles of a level.
struct TileView {
    axes: ViewAxes,
    origin: [f64; 2],
    tile_m: f64,
    /// Room for snapping and rounding, in tiles.
    room: f64,
}

/// In tiles, both ends included.
#[derive(Clone, Copy, Debug)]
struct Rect {
    pub lo: [f64; 2],
    pub hi: [f64; 2],
}

impl Rect {
    fn is_small(&self) -> bool {
        (0..2).all(|k| self.hi[k] - self.lo[k] <= SMALL_TILES)
    }
}

impl TileView {
    pub fn new(frame: &Frame, level: u8) -> Self {
        let tile_m = frame.size_m / f64::from(1u32 << level);
        let room = (frame.pixel_m(frame.zmax) / 64.0 + 1e-6) / tile_m;
        Self { axes: frame.axes(), origin: [frame.u0_m, frame.v0_m], tile_m, room }
    }

    fn tiles(&self, p: Vec3) -> [f64; 2] {
        let [u, v, _] = self.axes.uvd_from_local(p);
        [(u - self.origin[0]) / self.tile_m, (self.origin[1] - v) / self.tile_m]
    }

    pub fn rect(&self, b: &Box3) -> Rect {
        let (center, half) = (self.tiles(b.center()), b.half_extents());
        let spread = |axis: Vec3| (0..3).map(|k| axis[k].abs() * half[k]).sum::<f64>() / self.tile_m * (1.0 + 1e-12) + self.room;
        let spread = [spread(self.axes.right), spread(self.axes.up)];
        Rect { lo: [0, 1].map(|k| center[k] - spread[k]), hi: [0, 1].map(|k| center[k] + spread[k]) }
    }
}

struct Flags {
    side: usize,
    flags: Vec<bool>,
}

impl Flags {
    fn new(frame: &Frame, level: u8, value: bool) -> Result<Self> {
        frame.validate()?;
        if level > MAX_FLAGS_LEVEL {
            return Err(Error::argument(format!("occupancy: level is {level}, at most {MAX_FLAGS_LEVEL}")));
        }
        Ok(Self { side: 1 << level, flags: vec![value; 1 << (2 * level)] })
    }

    /// Sets all that may have content and is not set yet.
    fn mark(&mut self, scene: &SceneStore, frame: &Frame, level: u8) -> Result<()> {
        let view = TileView::new(frame, level);
        let mut outlines = Outlines::default();
        for part in scene.parts() {
            let rect = view.rect(&part.bounds);
            if !self.has_unset(&rect) {
                continue;
            }
            if rect.is_small() {
                self.set(&rect);
                continue;
            }
            let transform = part.instance.map(|k| scene.instances()[k as usize].transform);
            descend(outlines.get(scene, part)?, transform.as_ref(), &view, self)?;
        }
        Ok(())
    }

    /// First and last tile of a rectangle along an axis; `None` outside the square.
    fn range(&self, rect: &Rect, axis: usize) -> Option<(usize, usize)> {
        let side = self.side as f64;
        let meets = rect.hi[axis] >= 0.0 && rect.lo[axis] < side;
        meets.then(|| (rect.lo[axis].max(0.0) as usize, (rect.hi[axis].min(side - 0.5)) as usize))
    }

    fn tiles(&self, rect: &Rect) -> impl Iterator<Item = (usize, usize)> + use<> {
        let ranges = self.range(rect, 0).zip(self.range(rect, 1));
        ranges.into_iter().flat_map(|((x0, x1), (y0, y1))| (y0..=y1).flat_map(move |y| (x0..=x1).map(move |x| (x, y))))
    }

    fn has_unset(&self, rect: &Rect) -> bool {
        self.tiles(rect).any(|(x, y)| !self.flags[y * self.side + x])
    }

    fn set(&mut self, rect: &Rect) {
        self.tiles(rect).for_each(|(x, y)| self.flags[y * self.side + x] = true);
    }

    /// Tiles that no edge of the triangle has wholly outside.
    fn set_triangle(&mut self, c: &[[f64; 2]; 3], room: f64) {
        let lo = [0, 1].map(|k| c[0][k].min(c[1][k]).min(c[2][k]) - room);
        let hi = [0, 1].map(|k| c[0][k].max(c[1][k]).max(c[2][k]) + room);
        let rect = Rect { lo, hi };
        for (x, y) in self.tiles(&rect) {
            let tile = Rect { lo: [x as f64 - room, y as f64 - room], hi: [(x + 1) as f64 + room, (y + 1) as f64 + room] };
            if !(0..3).any(|k| edge_separates(c[k], c[(k + 1) % 3], c[(k + 2) % 3], &tile)) {
                self.flags[y * self.side + x] = true;
            }
        }
    }
}

/// Whether a rectangle lies wholly on the far side of the edge a → b from c.
fn edge_separates(a: [f64; 2], b: [f64; 2], c: [f64; 2], rect: &Rect) -> bool {
    let normal = [a[1] - b[1], b[0] - a[0]];
    let side = |p: [f64; 2]| normal[0] * (p[0] - a[0]) + normal[1] * (p[1] - a[1]);
    let sign = if side(c) < 0.0 { -1.0 } else { 1.0 };
    let nearest = [0, 1].map(|k| if sign * normal[k] > 0.0 { rect.hi[k] } else { rect.lo[k] });
    side(c) != 0.0 && sign * side(nearest) < 0.0
}
