//! Blocks: the unit of a job. Tiles are rendered in Morton order and reduced as soon as four siblings are there, so that memory stays a few tiles a level.

use std::collections::HashMap;

use map3d_base::tile::{Tile, block_levels};
use map3d_base::{Error, Frame, Result};
use map3d_image::encode::Encoder;
use map3d_image::seam::{read_seam, write_seam};
use map3d_image::{Arrays, GBuffer, reduce};

use crate::clock::CpuClock;
use crate::scene::RenderScene;
use crate::tile::{TileRenderer, check_tile};

/// One layer of one tile as sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EncodedTile {
    /// Index into the frame's layers.
    pub layer: usize,
    pub tile: Tile,
    pub bytes: Vec<u8>,
}

/// Seconds of the thread's CPU time by stage, and counts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BlockStats {
    pub visibility_s: f64,
    pub shade_s: f64,
    /// Of rays: suns, ambient occlusion, second surfaces.
    pub light_s: f64,
    pub reduce_s: f64,
    pub encode_s: f64,
    pub seam_s: f64,
    /// Base tiles with content.
    pub traced_tiles: u64,
    /// Tiles of all levels with content.
    pub tiles: u64,
    /// (pixel, surface) pairs shaded.
    pub shades: u64,
    /// Surfaces set up.
    pub setups: u64,
}

/// What a job yields. Tiles without content are not listed; each tile listed has all layers of the frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Block {
    pub tiles: Vec<EncodedTile>,
    /// `None`: the block has no content.
    pub seam: Option<Vec<u8>>,
    pub stats: BlockStats,
}

/// Where the deepest tiles of a block come from.
trait Leaves {
    /// Level of the deepest tiles that the source yields.
    fn level(&self) -> u8;
    fn tile(&mut self, tile: Tile) -> Result<Option<GBuffer>>;
    /// Whether the source's own tiles are part of the block, or of the blocks below.
    fn owned(&self) -> bool;
}

pub(crate) fn render_block(scene: &RenderScene, frame: &Frame, root: Tile) -> Result<Block> {
    frame.validate()?;
    check_root(frame, root, block_levels(frame.zmax)[0].0)?;
    let mut leaves = Traced(TileRenderer::new(scene, frame)?, frame.zmax, 0);
    let mut block = build(frame, root, &mut leaves)?;
    let Traced(renderer, _, traced) = leaves;
    (block.stats.visibility_s, block.stats.shade_s, block.stats.traced_tiles) = (renderer.visibility_s, renderer.shade_s, traced);
    block.stats.light_s = renderer.light_s;
    (block.stats.shades, block.stats.setups) = renderer.shade_counts();
    Ok(block)
}

/// A reduce block of `levels` levels; seams: those that exist of the blocks rooted at level `root.z + levels`, by (x, y).
pub fn reduce_block(frame: &Frame, root: Tile, levels: u8, seams: &[(u32, u32, &[u8])]) -> Result<Block> {
    frame.validate()?;
    check_tile(root)?;
    if !(1..=map3d_base::tile::BLOCK_DEPTH).contains(&levels) || root.z + levels > frame.zmax {
        return Err(Error::argument(format!("reduce block at level {} of {levels} levels, zmax is {}", root.z, frame.zmax)));
    }
    let mut by_place = HashMap::new();
    for (x, y, bytes) in seams {
        if (x >> levels, y >> levels) != (root.x, root.y) || by_place.insert((*x, *y), *bytes).is_some() {
            return Err(Error::argument(format!("seam ({x}, {y}) is not below ({}, {}, {}), or there twice", root.z, root.x, root.y)));
        }
    }
    build(frame, root, &mut Seams { by_place, level: root.z + levels, side: frame.tile_px, arrays: Arrays::of(&frame.layers) })
}

fn check_root(frame: &Frame, root: Tile, level: u8) -> Result<()> {
    check_tile(root)?;
    match root.z == level {
        true => Ok(()),
        false => Err(Error::argument(format!("base blocks of zmax {} are rooted at level {level}, not {}", frame.zmax, root.z))),
    }
}

fn build(frame: &Frame, root: Tile, leaves: &mut impl Leaves) -> Result<Block> {
    let mut work = Work { frame, encoder: Encoder::new(), block: Block::default() };
    let seam = work.node(root, leaves)?;
    let mut clock = CpuClock::start();
    work.block.seam = seam.map(|g| write_seam(&g));
    work.block.stats.seam_s = clock.lap_s();
    Ok(work.block)
}

struct Work<'a> {
    frame: &'a Frame,
    encoder: Encoder,
    block: Block,
}

impl Work<'_> {
    /// The G-buffer of a tile from what lies below it, in Morton order; encodes it if it is the block's own.
    fn node(&mut self, tile: Tile, leaves: &mut impl Leaves) -> Result<Option<GBuffer>> {
        if tile.z == leaves.level() {
            let g = leaves.tile(tile)?;
            if let Some(g) = g.as_ref().filter(|_| leaves.owned()) {
                self.encode(tile, g)?;
            }
            return Ok(g);
        }
        let mut children: [Option<GBuffer>; 4] = [const { None }; 4];
        for (child, place) in children.iter_mut().zip(tile.children()) {
            *child = self.node(place, leaves)?;
        }
        if children.iter().all(Option::is_none) {
            return Ok(None);
        }
        let mut clock = CpuClock::start();
        let parent = reduce(children.each_ref().map(Option::as_ref), self.frame.tile_px);
        self.block.stats.reduce_s += clock.lap_s();
        self.encode(tile, &parent)?;
        Ok(Some(parent))
    }

    fn encode(&mut self, tile: Tile, g: &GBuffer) -> Result<()> {
        let mut clock = CpuClock::start();
        for (layer, spec) in self.frame.layers.iter().enumerate() {
            let bytes = self.encoder.layer(g, spec)?;
            self.block.tiles.push(EncodedTile { layer, tile, bytes });
        }
        self.block.stats.encode_s += clock.lap_s();
        self.block.stats.tiles += 1;
        Ok(())
    }
}

/// Base tiles: renderer, zmax, tiles with content so far.
struct Traced<'s>(TileRenderer<'s>, u8, u64);

impl Leaves for Traced<'_> {
    fn level(&self) -> u8 {
        self.1
    }

    fn tile(&mut self, tile: Tile) -> Result<Option<GBuffer>> {
        let g = self.0.tile(tile.x, tile.y)?;
        self.2 += u64::from(g.is_some());
        Ok(g)
    }

    fn owned(&self) -> bool {
        true
    }
}

/// Root tiles of the blocks below, which have encoded them.
struct Seams<'a> {
    by_place: HashMap<(u32, u32), &'a [u8]>,
    level: u8,
    side: u32,
    arrays: Arrays,
}

impl Leaves for Seams<'_> {
    fn level(&self) -> u8 {
        self.level
    }

    fn tile(&mut self, tile: Tile) -> Result<Option<GBuffer>> {
        let Some(bytes) = self.by_place.get(&(tile.x, tile.y)) else { return Ok(None) };
        let name = format!("seam {}/{}/{}", tile.z, tile.x, tile.y);
        let g = read_seam(&name, bytes)?;
        match (g.width, g.height) == (self.side, self.side) {
            false => Err(Error::format(name, format!("{} × {} px, expected {}", g.width, g.height, self.side))),
            true if g.arrays() != self.arrays => Err(Error::format(name, "it has not the arrays of the frame's layers")),
            true => Ok(Some(g)),
        }
    }

    fn owned(&self) -> bool {
        false
    }
}
