//! Keys of base blocks: hashes over everything that their bytes depend on, decided conservatively from boxes.

use std::collections::HashMap;

use map3d_base::limits::DEEPEST_LEVEL;
use map3d_base::tile::Tile;
use map3d_base::{Box3, Error, Frame, RENDER_FORMAT, Result};
use map3d_scene::SceneStore;
use twox_hash::XxHash3_128;

use super::reach::Reach;
use super::{TileRect, TileView};

/// The class of devices that render by default.
pub const CPU: &str = "cpu";

/// Returns the keys of base blocks of one level, (x, y) each: hex hashes over everything that their bytes depend on, which is the format, the class of devices
/// that render, the frame, and every object and instance whose box meets the block's beam, casts a shadow into it or occludes ambient light there. Opens
/// every chunk once.
pub fn block_keys(scene: &SceneStore, frame: &Frame, device: &str, level: u8, blocks: &[[u32; 2]]) -> Result<Vec<String>> {
    frame.validate()?;
    if let Some([x, y]) = blocks.iter().find(|[x, y]| level > DEEPEST_LEVEL || x >> level != 0 || y >> level != 0) {
        return Err(Error::argument(format!("block {level}/{x}/{y} does not exist")));
    }
    let view = TileView::new(frame, level);
    let reach = Reach::new(frame, &view, &scene.bounds());
    let mut sums = Sums::new(view, reach, blocks);
    for part in scene.parts() {
        if !sums.meets_any(&part.bounds) {
            continue;
        }
        if let Some(k) = part.instance {
            let record = &scene.instances()[k as usize];
            sums.add(&part.bounds, record.object_id, record.content);
            continue;
        }
        let chunk = scene.open_lazily(part.chunk)?;
        let o = chunk.origin();
        for object in chunk.objects() {
            let b = [0, 1, 2, 3, 4, 5].map(|k| o[k % 3] + f64::from(object.bounds[k]));
            sums.add(&Box3 { lo: [b[0], b[1], b[2]], hi: [b[3], b[4], b[5]] }, object.id, object.content);
        }
    }
    Ok(blocks.iter().zip(&sums.sums).map(|(block, sum)| finish(frame, device, level, *block, sum)).collect())
}

/// Per block, the number of objects and instances that meet its beam and the sum of their hashes modulo 2^128, so that their order does not matter.
struct Sums<'a> {
    view: TileView,
    reach: Reach,
    blocks: &'a [[u32; 2]],
    numbers: HashMap<[u32; 2], Vec<u32>>,
    sums: Vec<(u64, u128)>,
    /// First and last column and row with a block.
    span: [[u32; 2]; 2],
}

impl<'a> Sums<'a> {
    fn new(view: TileView, reach: Reach, blocks: &'a [[u32; 2]]) -> Self {
        let mut numbers: HashMap<[u32; 2], Vec<u32>> = HashMap::new();
        blocks.iter().zip(0..).for_each(|(b, k)| numbers.entry(*b).or_default().push(k));
        let end = |k: usize| [blocks.iter().map(|b| b[k]).min().unwrap_or(1), blocks.iter().map(|b| b[k]).max().unwrap_or(0)];
        Self { view, reach, blocks, numbers, sums: vec![(0, 0); blocks.len()], span: [end(0), end(1)] }
    }

    /// Returns the first and last column and row with a block that a rectangle meets.
    fn tiles(&self, rect: &TileRect) -> [[u32; 2]; 2] {
        // A rectangle whose border is that of a tile meets both tiles.
        let first = |k: usize| ((rect.lo[k].ceil() - 1.0).max(0.0) as u32).max(self.span[k][0]);
        let last = |k: usize| if rect.hi[k] < 0.0 { None } else { Some((rect.hi[k] as u32).min(self.span[k][1])) };
        [0, 1].map(|k| last(k).map_or([1, 0], |last| [first(k), last]))
    }

    fn meets_any(&self, bounds: &Box3) -> bool {
        let mut any = false;
        let meets = |rect: &TileRect| self.tiles(rect).iter().all(|[first, last]| first <= last);
        self.reach.each(bounds, self.view.rect(bounds), |rect| any |= meets(rect));
        any
    }

    /// Adds an object or instance to every block that it reaches. One that reaches a block in several ways counts several times, always the same number.
    fn add(&mut self, bounds: &Box3, id: u32, content: [u64; 2]) {
        let mut reached = Vec::new();
        self.reach.each(bounds, self.view.rect(bounds), |rect| reached.push(self.tiles(rect)));
        let value = content_hash(id, content);
        reached.into_iter().for_each(|tiles| self.add_to(tiles, value));
    }

    fn add_to(&mut self, [[x0, x1], [y0, y1]]: [[u32; 2]; 2], value: u128) {
        if x0 > x1 || y0 > y1 {
            return;
        }
        let mut take = |k: u32| {
            let sum = &mut self.sums[k as usize];
            *sum = (sum.0 + 1, sum.1.wrapping_add(value));
        };
        if u64::from(x1 - x0 + 1) * u64::from(y1 - y0 + 1) > self.blocks.len() as u64 {
            let inside = |b: &[u32; 2]| (x0..=x1).contains(&b[0]) && (y0..=y1).contains(&b[1]);
            self.blocks.iter().zip(0..).filter(|(b, _)| inside(b)).for_each(|(_, k)| take(k));
            return;
        }
        for place in (y0..=y1).flat_map(|y| (x0..=x1).map(move |x| [x, y])) {
            self.numbers.get(&place).into_iter().flatten().for_each(|k| take(*k));
        }
    }
}

fn content_hash(id: u32, content: [u64; 2]) -> u128 {
    XxHash3_128::oneshot(bytemuck::bytes_of(&[u64::from(id), content[0], content[1]]))
}

fn finish(frame: &Frame, device: &str, level: u8, [x, y]: [u32; 2], (count, sum): &(u64, u128)) -> String {
    let mut hash = XxHash3_128::with_seed(0);
    write_frame(&mut hash, frame, Tile { z: level, x, y });
    hash.write(&count.to_le_bytes());
    hash.write(&sum.to_le_bytes());
    // Keys of the default class are older than classes.
    if device != CPU {
        hash.write(device.as_bytes());
    }
    format!("{:032x}", hash.finish_128())
}

fn write_frame(hash: &mut XxHash3_128, frame: &Frame, root: Tile) {
    let numbers = [frame.look_at_deg, frame.pitch_deg, frame.u0_m, frame.v0_m, frame.d0_m, frame.size_m];
    hash.write(&RENDER_FORMAT.to_le_bytes());
    numbers.iter().for_each(|v| hash.write(&v.to_bits().to_le_bytes()));
    [frame.tile_px, u32::from(frame.zmax), u32::from(root.z), root.x, root.y].iter().for_each(|v| hash.write(&v.to_le_bytes()));
    for layer in &frame.layers {
        hash.write(&[layer.kind as u8, layer.format as u8, layer.quality | u8::from(layer.small) << 7]);
        layer.suns.iter().flatten().chain([&layer.radius_m]).for_each(|v| hash.write(&v.to_bits().to_le_bytes()));
    }
}
