//! Blocks: pixels do not depend on tiling, reduction does not depend on blocks, bytes do not depend on threads.

use std::collections::BTreeMap;

use crate::town::{TempFolder, Town, all_layers, bricks, frame, new_folder};
use map3d_base::asset::Wrap;
use map3d_base::layers::{COLOR, DEPTH, ID, NORMAL};
use map3d_base::tile::Tile;
use map3d_base::{Frame, LayerFormat, LayerKind, Result};
use map3d_image::GBuffer;
use map3d_image::encode::{bytes_from_u32, decode_png};
use map3d_image::seam::read_seam;
use map3d_render::{Block, RenderScene, TileRenderer, TileSource, build_block, reduce_block};

fn scene(name: &str) -> (TempFolder, RenderScene) {
    let mut town = Town::default();
    let (brick, red) = (town.textured(bricks(128), Wrap::Mirror), town.flat([0.9, 0.1, 0.05]));
    town.ground(70.0, 9.0, brick, 0);
    for k in 0..6u32 {
        let x = f64::from(k) * 19.0 - 60.0;
        town.house([x, x * 0.7], [9.0, 7.0, 5.0 + f64::from(k) * 3.0], if k % 2 == 0 { brick } else { red }, 1 + 5 * k);
    }
    let folder = new_folder(name);
    let scene = town.open(&folder);
    (folder, scene)
}

fn tile_of(block: &Block, layer: usize, tile: Tile) -> Option<&[u8]> {
    block.tiles.iter().find(|t| t.layer == layer && t.tile == tile).map(|t| &t.bytes[..])
}

const ROOT: Tile = Tile { z: 0, x: 0, y: 0 };

/// Returns the frame with tiles twice as large and one level less: the same pixels.
fn with_large_tiles(f: &Frame) -> Frame {
    Frame { tile_px: 512, zmax: f.zmax - 1, ..f.clone() }
}

#[test]
fn pixels_do_not_depend_on_tiling() {
    let (_folder, scene) = scene("tiling");
    for (look_at, pitch) in [(0.0, 45.0), (33.0, 22.5)] {
        let f = frame(look_at, pitch, 160.0, 2);
        let large = with_large_tiles(&f);
        let mut compared = 0;
        for (x, y) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let big = scene.gbuffer(&large, x, y).expect("renders");
            for k in 0..4u32 {
                let small = scene.gbuffer(&f, 2 * x + k % 2, 2 * y + k / 2).expect("renders");
                assert_eq!(small, crop(&big, k % 2 * 256, k / 2 * 256), "tile {k} of ({x}, {y})");
                compared += usize::from(!small.is_empty());
            }
        }
        assert!(compared >= 8);
    }
}

fn crop(g: &GBuffer, left: u32, top: u32) -> GBuffer {
    let mut out = GBuffer::empty(256, 256);
    for y in 0..256usize {
        let (from, to) = ((y + top as usize) * g.width as usize + left as usize, y * 256);
        out[COLOR][to..to + 256].copy_from_slice(&g[COLOR][from..from + 256]);
        out[NORMAL][to..to + 256].copy_from_slice(&g[NORMAL][from..from + 256]);
        out[ID][to..to + 256].copy_from_slice(&g[ID][from..from + 256]);
        out[DEPTH][to..to + 256].copy_from_slice(&g[DEPTH][from..from + 256]);
    }
    out
}

#[test]
fn block_has_its_tiles_in_all_layers_and_a_seam() {
    let (_folder, scene) = scene("block");
    let f = frame(0.0, 45.0, 160.0, 2);
    let block = scene.render_block(&f, ROOT).expect("renders");
    let mut tiles: BTreeMap<Tile, usize> = BTreeMap::new();
    block.tiles.iter().for_each(|t| *tiles.entry(t.tile).or_default() += 1);
    assert!(tiles.values().all(|layers| *layers == 4));
    assert_eq!(block.stats.tiles as usize, tiles.len());
    assert_eq!(block.stats.traced_tiles as usize, tiles.keys().filter(|t| t.z == 2).count());
    let mut renderer = TileRenderer::new(&scene, &f).expect("a frame");
    for y in 0..4 {
        for x in 0..4 {
            let (g, tile) = (renderer.tile(x, y).expect("renders"), Tile { z: 2, x, y });
            let id = tile_of(&block, 2, tile);
            assert_eq!(g.is_some(), id.is_some(), "{tile:?}");
            if let (Some(g), Some(id)) = (g, id) {
                assert_eq!(decode_png(id).expect("sound").pixels, bytes_from_u32(&g[ID]));
            }
        }
    }
    assert!(tiles.contains_key(&ROOT));
    let seam = read_seam("root", block.seam.as_deref().expect("has content")).expect("sound");
    assert_eq!(decode_png(tile_of(&block, 3, ROOT).expect("root")).expect("sound").pixels, bytes_from_u32(&seam[DEPTH]));
}

/// A back end that wants the tiles of several levels in one call.
struct OtherBackEnd<'s> {
    renderer: TileRenderer<'s>,
    levels: u8,
    calls: Vec<usize>,
}

impl TileSource for OtherBackEnd<'_> {
    fn level(&self) -> u8 {
        2
    }

    fn tiles(&mut self, tiles: &[Tile]) -> Result<Vec<Option<GBuffer>>> {
        self.calls.push(tiles.len());
        tiles.iter().map(|tile| self.renderer.tile(tile.x, tile.y)).collect()
    }

    fn levels_at_once(&self) -> u8 {
        self.levels
    }

    fn is_in_block(&self) -> bool {
        true
    }
}

#[test]
fn bytes_do_not_depend_on_how_many_tiles_are_asked_for_at_once() {
    let (_folder, scene) = scene("at-once");
    let f = frame(0.0, 45.0, 160.0, 2);
    let expected = scene.render_block(&f, ROOT).expect("renders");
    for (levels, calls) in [(0, vec![1; 16]), (1, vec![4; 4]), (2, vec![16]), (5, vec![16])] {
        let mut source = OtherBackEnd { renderer: TileRenderer::new(&scene, &f).expect("a frame"), levels, calls: Vec::new() };
        let block = build_block(&f, ROOT, &mut source).expect("builds");
        assert_eq!((block.tiles, block.seam), (expected.tiles.clone(), expected.seam.clone()), "{levels} levels");
        assert_eq!(source.calls, calls);
    }
}

/// A reduce block of four base blocks gives the same root as reducing their seams directly.
#[test]
fn reduction_through_seams_equals_direct_reduction() {
    let (_folder, scene) = scene("seams");
    let f = frame(30.0, 45.0, 160.0, 3);
    let whole = scene.render_block(&f, ROOT).expect("renders");
    let deeper = Frame { zmax: 4, ..f.clone() };
    let mut seams = Vec::new();
    for (x, y) in [(0u32, 0u32), (1, 0), (0, 1), (1, 1)] {
        let block = scene.render_block(&deeper, Tile { z: 1, x, y }).expect("renders");
        assert!(block.tiles.iter().all(|t| t.tile.z >= 1 && t.tile.x >> (t.tile.z - 1) == x && t.tile.y >> (t.tile.z - 1) == y));
        seams.extend(block.seam.map(|s| (x, y, s)));
    }
    let given: Vec<(u32, u32, &[u8])> = seams.iter().map(|(x, y, s)| (*x, *y, &s[..])).collect();
    let top = reduce_block(&deeper, ROOT, 1, &given).expect("reduces");
    assert_eq!(top.tiles.len(), 4, "the root tile's layers");
    let children = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|p| given.iter().find(|s| (s.0, s.1) == p).map(|s| read_seam("child", s.2).expect("sound")));
    let direct = map3d_image::reduce(children.each_ref().map(Option::as_ref), 256);
    assert_eq!(read_seam("root", top.seam.as_deref().expect("content")).expect("sound"), direct);
    let mut reversed = given.clone();
    reversed.reverse();
    assert_eq!(reduce_block(&deeper, ROOT, 1, &reversed).expect("reduces").tiles, top.tiles);
    assert!(whole.tiles.len() > 4);
}

#[test]
fn reduce_block_rejects_wrong_seams() {
    let (_folder, scene) = scene("wrong-seams");
    let f = frame(0.0, 45.0, 160.0, 4);
    let seam = scene.render_block(&f, Tile { z: 1, x: 0, y: 0 }).expect("renders").seam.expect("content");
    assert!(reduce_block(&f, ROOT, 1, &[(0, 0, &seam), (0, 0, &seam)]).is_err(), "given twice");
    assert!(reduce_block(&f, ROOT, 1, &[(2, 0, &seam)]).is_err(), "outside of the block");
    assert!(reduce_block(&f, ROOT, 1, &[(0, 0, &seam[..seam.len() - 1])]).is_err(), "damaged");
    assert!(reduce_block(&Frame { tile_px: 512, ..f.clone() }, ROOT, 1, &[(0, 0, &seam)]).is_err(), "another tile size");
    assert!(reduce_block(&f, ROOT, 4, &[]).is_err() && reduce_block(&f, ROOT, 0, &[]).is_err());
    assert!(scene.render_block(&f, ROOT).is_err(), "the root of a base block is at level zmax − 3");
    let nothing = reduce_block(&f, ROOT, 1, &[]).expect("reduces");
    assert_eq!((nothing.tiles.len(), nothing.seam), (0, None));
}

#[test]
fn block_without_content_is_empty() {
    let (_folder, scene) = scene("empty");
    let f = Frame { u0_m: 5_000.0, ..frame(0.0, 45.0, 160.0, 3) };
    let block = scene.render_block(&f, ROOT).expect("renders");
    assert_eq!((block.tiles.len(), block.seam, block.stats.traced_tiles), (0, None, 0));
}

#[test]
fn bytes_do_not_depend_on_threads() {
    let (folder, first) = scene("threads");
    for color in [LayerFormat::Webp, LayerFormat::Jpeg, LayerFormat::Png] {
        let f = Frame { layers: all_layers(color), ..frame(10.0, 30.0, 160.0, 4) };
        let roots = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| Tile { z: 1, x, y });
        let alone: Vec<Block> = roots.iter().map(|r| first.render_block(&f, *r).expect("renders")).collect();
        let shared = RenderScene::open(&folder.0, 1 << 20).expect("opens");
        let together: Vec<Block> = std::thread::scope(|s| {
            let jobs: Vec<_> = roots.iter().rev().map(|r| s.spawn(|| shared.render_block(&f, *r).expect("renders"))).collect();
            jobs.into_iter().rev().map(|j| j.join().expect("no panic")).collect()
        });
        for (a, b) in alone.iter().zip(&together) {
            assert!(a.tiles == b.tiles && a.seam == b.seam, "{color:?}");
        }
        assert!(f.layers[0].kind == LayerKind::Color);
    }
}
