//! Blocks: the unit of a job. Tiles are rendered in Morton order and reduced as soon as four siblings are complete, so that memory holds only a few tiles
//! per level.

use std::collections::{HashMap, VecDeque};

use map3d_base::tile::{Tile, block_levels};
use map3d_base::{Error, Frame, Result};
use map3d_image::encode::Encoder;
use map3d_image::seam::{read_seam, write_seam};
use map3d_image::{Arrays, GBuffer, reduce};

use crate::clock::CpuClock;
use crate::scene::RenderScene;
use crate::subtile::StageTimes;
use crate::tile::TileRenderer;

/// One layer of one tile, encoded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EncodedTile {
    /// Index into the frame's layers.
    pub layer: usize,
    pub tile: Tile,
    pub bytes: Vec<u8>,
}

/// The thread's CPU time by stage in seconds, and counts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BlockStats {
    pub visibility_s: f64,
    pub shade_s: f64,
    /// Ray packets: suns, ambient occlusion, second surfaces.
    pub light_s: f64,
    pub reduce_s: f64,
    pub encode_s: f64,
    pub seam_s: f64,
    /// Base tiles with content.
    pub traced_tiles: u64,
    /// Tiles of all levels with content.
    pub tiles: u64,
    /// Shaded (pixel, surface) pairs.
    pub shades: u64,
    /// Prepared surfaces.
    pub setups: u64,
}

/// The result of a job. Empty tiles are not listed; each listed tile has all layers of the frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Block {
    pub tiles: Vec<EncodedTile>,
    /// `None` for an empty block.
    pub seam: Option<Vec<u8>>,
    pub stats: BlockStats,
}

impl RenderScene {
    /// Renders a base block: its tiles in all layers of the frame, and its seam.
    pub fn render_block(&self, frame: &Frame, root: Tile) -> Result<Block> {
        frame.validate()?;
        check_tile(root)?;
        let level = block_levels(frame.zmax)[0].0;
        if root.z != level {
            return Err(Error::argument(format!("base blocks of zmax {} have their roots at level {level}, got level {}", frame.zmax, root.z)));
        }
        let mut source = RenderedTiles { renderer: TileRenderer::new(self, frame)?, zmax: frame.zmax, count: 0 };
        let mut block = build_block(frame, root, &mut source)?;
        let RenderedTiles { renderer, count, .. } = source;
        let StageTimes { visibility_s, shade_s, light_s } = renderer.times();
        let (shades, setups) = renderer.shade_counts();
        block.stats = BlockStats { visibility_s, shade_s, light_s, traced_tiles: count, shades, setups, ..block.stats };
        Ok(block)
    }
}

/// Builds a reduce block of `levels` levels from the seams, by (x, y), of the blocks with roots at level `root.z + levels`. Blocks without a seam are empty.
pub fn reduce_block(frame: &Frame, root: Tile, levels: u8, seams: &[(u32, u32, &[u8])]) -> Result<Block> {
    frame.validate()?;
    check_tile(root)?;
    if !(1..=map3d_base::tile::BLOCK_DEPTH).contains(&levels) || root.z + levels > frame.zmax {
        return Err(Error::argument(format!("reduce block at level {} of {levels} levels is out of range: zmax is {}", root.z, frame.zmax)));
    }
    let mut by_tile = HashMap::new();
    for (x, y, bytes) in seams {
        if (x >> levels, y >> levels) != (root.x, root.y) || by_tile.insert((*x, *y), *bytes).is_some() {
            return Err(Error::argument(format!("seam ({x}, {y}) is given twice or is not below tile ({}, {}, {})", root.z, root.x, root.y)));
        }
    }
    build_block(frame, root, &mut SeamTiles { by_tile, level: root.z + levels, side: frame.tile_px, arrays: Arrays::of(&frame.layers) })
}

/// Fails for a tile outside of its level.
fn check_tile(tile: Tile) -> Result<()> {
    let count = 1u64 << tile.z.min(map3d_base::limits::DEEPEST_LEVEL);
    match tile.z <= map3d_base::limits::DEEPEST_LEVEL && u64::from(tile.x) < count && u64::from(tile.y) < count {
        true => Ok(()),
        false => Err(Error::argument(format!("tile ({}, {}, {}) is out of range", tile.z, tile.x, tile.y))),
    }
}

/// Builds a block from its deepest tiles: reduces and encodes them, and writes the seam. The bytes depend on nothing but the frame and the tiles.
pub fn build_block(frame: &Frame, root: Tile, source: &mut dyn TileSource) -> Result<Block> {
    let mut builder = BlockBuilder { frame, encoder: Encoder::new(), block: Block::default(), fetched: VecDeque::new() };
    let seam = builder.build_tile(root, source)?;
    let mut clock = CpuClock::start();
    builder.block.seam = seam.map(|g| write_seam(&g));
    builder.block.stats.seam_s = clock.lap_s();
    Ok(builder.block)
}

/// The source of a block's deepest tiles. A back end of the tracer is a source; reduction, encoding and seams are above it, the same for all.
///
/// `build_block` asks for each tile once, in Morton order, and calls one method at a time. A G-buffer has the arrays of the frame's layers and the tile's
/// full size; `None` means that no pixel has a surface. Equal tiles have equal bytes, whichever tiles are asked for together. An error ends the block.
pub trait TileSource {
    /// The level of the tiles that the source yields.
    fn level(&self) -> u8;

    /// Returns the G-buffers of tiles of that level, in their order; `None` for an empty tile.
    fn tiles(&mut self, tiles: &[Tile]) -> Result<Vec<Option<GBuffer>>>;

    /// The number of levels under a tile whose tiles are asked for in one call: 4 siblings for 1, 64 tiles for 3, in Morton order. All of them are in memory
    /// until they are reduced; siblings are so in any case.
    fn levels_at_once(&self) -> u8 {
        1
    }

    /// Whether the source's tiles are part of the block; otherwise they belong to the blocks below.
    fn is_in_block(&self) -> bool;
}

struct BlockBuilder<'a> {
    frame: &'a Frame,
    encoder: Encoder,
    block: Block,
    /// The source's next tiles.
    fetched: VecDeque<Option<GBuffer>>,
}

impl BlockBuilder<'_> {
    /// Returns the G-buffer of a tile and encodes it if it is part of the block. Tiles above the source are reduced from their children, in Morton order.
    fn build_tile(&mut self, tile: Tile, source: &mut dyn TileSource) -> Result<Option<GBuffer>> {
        // The tiles of the deepest level under this one.
        let depth = source.level() - tile.z;
        if depth <= source.levels_at_once() && self.fetched.is_empty() {
            let asked = descendants(tile, depth);
            self.fetched = source.tiles(&asked)?.into();
            assert_eq!(self.fetched.len(), asked.len(), "a source answers for each tile");
        }

        // The deepest level.
        if depth == 0 {
            let g = self.fetched.pop_front().expect("fetched above");
            if let Some(g) = g.as_ref().filter(|_| source.is_in_block()) {
                self.encode(tile, g)?;
            }
            return Ok(g);
        }

        // The children.
        let mut children: [Option<GBuffer>; 4] = [const { None }; 4];
        for (g, child) in children.iter_mut().zip(tile.children()) {
            *g = self.build_tile(child, source)?;
        }
        if children.iter().all(Option::is_none) {
            return Ok(None);
        }

        // The tile itself.
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

/// Returns the tiles a number of levels under a tile, in Morton order.
fn descendants(tile: Tile, levels: u8) -> Vec<Tile> {
    (0..levels).fold(vec![tile], |above, _| above.into_iter().flat_map(Tile::children).collect())
}

/// Base tiles, rendered.
struct RenderedTiles<'s> {
    renderer: TileRenderer<'s>,
    zmax: u8,
    /// Tiles with content so far.
    count: u64,
}

impl TileSource for RenderedTiles<'_> {
    fn level(&self) -> u8 {
        self.zmax
    }

    fn tiles(&mut self, tiles: &[Tile]) -> Result<Vec<Option<GBuffer>>> {
        let all: Vec<_> = tiles.iter().map(|tile| self.renderer.tile(tile.x, tile.y)).collect::<Result<_>>()?;
        self.count += all.iter().flatten().count() as u64;
        Ok(all)
    }

    fn is_in_block(&self) -> bool {
        true
    }
}

/// Root tiles of the blocks below, read from their seams.
struct SeamTiles<'a> {
    by_tile: HashMap<(u32, u32), &'a [u8]>,
    level: u8,
    side: u32,
    arrays: Arrays,
}

impl SeamTiles<'_> {
    fn tile(&self, tile: &Tile) -> Result<Option<GBuffer>> {
        let Some(bytes) = self.by_tile.get(&(tile.x, tile.y)) else { return Ok(None) };
        let name = format!("seam {}/{}/{}", tile.z, tile.x, tile.y);
        let g = read_seam(&name, bytes)?;
        match (g.width, g.height) == (self.side, self.side) {
            false => Err(Error::format(name, format!("{} × {} px, expected {}", g.width, g.height, self.side))),
            true if g.arrays() != self.arrays => Err(Error::format(name, "arrays do not match the frame's layers")),
            true => Ok(Some(g)),
        }
    }
}

impl TileSource for SeamTiles<'_> {
    fn level(&self) -> u8 {
        self.level
    }

    fn tiles(&mut self, tiles: &[Tile]) -> Result<Vec<Option<GBuffer>>> {
        tiles.iter().map(|tile| self.tile(tile)).collect()
    }

    fn is_in_block(&self) -> bool {
        false
    }
}
