//! Finds the tiles that may have content, conservatively, from boxes and triangles.

mod keys;
mod reach;
mod tile_set;

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use map3d_base::limits::DEEPEST_LEVEL;
use map3d_base::{Box3, Error, Frame, Result, Vec3, ViewAxes};
use map3d_scene::instances::{place, placed_box};
use map3d_scene::records::{EMPTY, LEAF_BIT};
use map3d_scene::{LazyChunk, Leaf, ScenePart, SceneStore};

pub use keys::{CPU, block_keys};
use tile_set::{TileRange, TileSet};

/// Boxes up to this fraction of a tile are marked as a whole.
const SMALL_TILES: f64 = 0.25;

/// Returns the tiles of a level that may have content, as sorted Morton numbers. A tile that is not among them has none.
pub fn occupied(scene: &SceneStore, frame: &Frame, level: u8) -> Result<Vec<u64>> {
    occupied_within(scene, frame, level, 0, &[[0, 0]])
}

/// Returns those of `occupied` that lie in some blocks of a level above, (x, y) each; visits nothing else.
pub fn occupied_within(scene: &SceneStore, frame: &Frame, level: u8, block_level: u8, blocks: &[[u32; 2]]) -> Result<Vec<u64>> {
    frame.validate()?;
    if level > DEEPEST_LEVEL {
        return Err(Error::argument(format!("occupancy: level is {level}, expected at most {DEEPEST_LEVEL}")));
    }
    if block_level > level {
        return Err(Error::argument(format!("occupancy: blocks of level {block_level} are below level {level}")));
    }
    if let Some([x, y]) = blocks.iter().find(|b| b.iter().any(|v| v >> block_level != 0)) {
        return Err(Error::argument(format!("occupancy: block {block_level}/{x}/{y} does not exist")));
    }
    let mut marker = Marker { view: TileView::new(frame, level), tiles: TileSet::new(level, block_level, blocks) };
    marker.mark_scene(scene)?;
    Ok(marker.tiles.numbers())
}

/// Open outlines: those of prototypes stay open for further instances, of chunks only the last.
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

/// From local points to tile coordinates of a level.
struct TileView {
    axes: ViewAxes,
    origin: [f64; 2],
    tile_m: f64,
    /// Margin for snapping and rounding, in tiles.
    room: f64,
}

/// A rectangle in tiles, both ends included.
#[derive(Clone, Copy, Debug)]
struct TileRect {
    pub lo: [f64; 2],
    pub hi: [f64; 2],
}

impl TileRect {
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

    pub fn rect(&self, b: &Box3) -> TileRect {
        let (center, half) = (self.tiles(b.center()), b.half_extents());
        let spread = |axis: Vec3| (0..3).map(|k| axis[k].abs() * half[k]).sum::<f64>() / self.tile_m * (1.0 + 1e-12) + self.room;
        let spread = [spread(self.axes.right), spread(self.axes.up)];
        TileRect { lo: [0, 1].map(|k| center[k] - spread[k]), hi: [0, 1].map(|k| center[k] + spread[k]) }
    }
}

/// Marks the tiles of a level that may show something.
struct Marker {
    view: TileView,
    tiles: TileSet,
}

impl Marker {
    fn mark_scene(&mut self, scene: &SceneStore) -> Result<()> {
        let mut outlines = Outlines::default();
        for part in scene.parts() {
            if self.must_descend(&part.bounds) {
                let transform = part.instance.map(|k| scene.instances()[k as usize].transform);
                self.mark_chunk(outlines.get(scene, part)?, transform.as_ref())?;
            }
        }
        Ok(())
    }

    /// Marks the tiles of a small box at once. Returns whether a larger one meets tiles that are not marked yet.
    fn must_descend(&mut self, bounds: &Box3) -> bool {
        let rect = self.view.rect(bounds);
        let Some(range) = self.range(&rect).filter(|range| self.tiles.has_unmarked(range)) else { return false };
        if rect.is_small() {
            self.tiles.mark(&range, |_| true);
        }
        !rect.is_small()
    }

    fn mark_chunk(&mut self, chunk: &LazyChunk, transform: Option<&[f64; 12]>) -> Result<()> {
        let origin = chunk.origin();
        let mut stack = vec![0u32];
        while let Some(child) = stack.pop() {
            if child & LEAF_BIT != 0 {
                self.mark_leaf(chunk.leaf(child & !LEAF_BIT)?, origin, transform);
                continue;
            }
            let node = chunk.node(child)?;
            for k in (0..8).filter(|k| node.child[*k] != EMPTY) {
                let b = [0, 1, 2, 3, 4, 5].map(|a| origin[a % 3] + f64::from(node.bounds[a][k]));
                let bounds = Box3 { lo: [b[0], b[1], b[2]], hi: [b[3], b[4], b[5]] };
                if self.must_descend(&transform.map_or(bounds, |t| placed_box(t, &bounds))) {
                    stack.push(node.child[k]);
                }
            }
        }
        Ok(())
    }

    fn mark_leaf(&mut self, leaf: &Leaf, origin: Vec3, transform: Option<&[f64; 12]>) {
        for lane in (0..8).take_while(|l| leaf.triangle[*l] != EMPTY) {
            let corners = [0, 3, 6].map(|c| {
                let p = [0, 1, 2].map(|k| origin[k] + f64::from(leaf.corners[c + k][lane]));
                self.view.tiles(transform.map_or(p, |t| place(t, p)))
            });
            self.mark_triangle(&corners);
        }
    }

    /// Marks the tiles that no edge of the triangle has wholly outside.
    fn mark_triangle(&mut self, c: &[[f64; 2]; 3]) {
        let room = self.view.room;
        let lo = [0, 1].map(|k| c[0][k].min(c[1][k]).min(c[2][k]) - room);
        let hi = [0, 1].map(|k| c[0][k].max(c[1][k]).max(c[2][k]) + room);
        let Some(range) = self.range(&TileRect { lo, hi }) else { return };
        self.tiles.mark(&range, |tiles| {
            let [lo, hi] = [0, 1].map(|end| [f64::from(tiles.x[end] + end as u32), f64::from(tiles.y[end] + end as u32)]);
            let rect = TileRect { lo: lo.map(|v| v - room), hi: hi.map(|v| v + room) };
            !(0..3).any(|k| edge_separates(c[k], c[(k + 1) % 3], c[(k + 2) % 3], &rect))
        });
    }

    /// The tiles that a rectangle meets; `None` outside the square.
    fn range(&self, rect: &TileRect) -> Option<TileRange> {
        let side = f64::from(self.tiles.side());
        let line = |k: usize| {
            let meets = rect.hi[k] >= 0.0 && rect.lo[k] < side;
            meets.then(|| [rect.lo[k].max(0.0) as u32, rect.hi[k].min(side - 0.5) as u32])
        };
        Some(TileRange { x: line(0)?, y: line(1)? })
    }
}

/// Whether the edge a → b separates a rectangle from the corner c.
fn edge_separates(a: [f64; 2], b: [f64; 2], c: [f64; 2], rect: &TileRect) -> bool {
    let normal = [a[1] - b[1], b[0] - a[0]];
    let side = |p: [f64; 2]| normal[0] * (p[0] - a[0]) + normal[1] * (p[1] - a[1]);
    let sign = if side(c) < 0.0 { -1.0 } else { 1.0 };
    let nearest = [0, 1].map(|k| if sign * normal[k] > 0.0 { rect.hi[k] } else { rect.lo[k] });
    side(c) != 0.0 && sign * side(nearest) < 0.0
}
