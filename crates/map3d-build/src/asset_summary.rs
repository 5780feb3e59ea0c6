//! Summaries of assets (spec/scene.md, Asset summary), so that the next build reads only the assets that changed.

use std::collections::HashMap;
use std::path::Path;

use bytemuck::{Pod, Zeroable};
use map3d_base::file::{self, HEADER_BYTES, aligned, header_start};
use map3d_base::{Box3, Error, Result};
use map3d_scene::records::{InstanceRecord, MaterialRecord};
use map3d_texture::{TextureInfo, TextureSource};
use serde::{Deserialize, Serialize};
use twox_hash::{XxHash3_64, XxHash3_128};

use crate::BuildReport;
use crate::ground::GroundLevel;
use crate::lows::Lows;
use crate::triangle::BuildTriangle;

pub(crate) const EXTENSION: &str = "m3v";
const MAGIC: &[u8; 4] = b"M3DV";
const VERSION: u32 = 2;

/// Summary of one asset. Follows from the asset, the request and the keys of its textures; `cells` also from the square.
#[derive(Clone, Debug, Default)]
pub(crate) struct AssetSummary {
    pub details: AssetDetails,
    /// In the order of cells.
    pub cells: Vec<CellSum>,
    /// `prototype` is an index into `AssetDetails::prototypes`; in the order of the asset.
    pub instances: Vec<InstanceRecord>,
    /// Ids of all its objects.
    pub ids: Vec<u32>,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct AssetDetails {
    /// Digest of the input of the summary; the file calls it `mark`.
    #[serde(rename = "mark")]
    pub digest: String,
    pub level: LevelDocument,
    /// The level in each region of the extent, if it has several.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub levels: Vec<LevelDocument>,
    /// This asset's share of the report.
    pub counts: BuildReport,
    pub textures: Vec<SummaryTexture>,
    /// Hash of each material's record.
    pub materials: Vec<u64>,
    /// Files of prototypes, relative to the scene's folder.
    pub prototypes: Vec<String>,
    /// x0, y0 and side, as bits, of the square to which `cells` belong.
    pub square: [u64; 3],
}

/// A texture that triangles use; without a key its image is missing or broken.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct SummaryTexture {
    pub texture: Option<String>,
    pub alpha: Option<String>,
    pub key: Option<[u8; 16]>,
    pub width: u32,
    pub height: u32,
    pub has_alpha: bool,
}

impl SummaryTexture {
    pub fn new(source: TextureSource, info: Option<&TextureInfo>) -> Self {
        let (width, height, has_alpha) = info.map_or((0, 0, false), |i| (i.width, i.height, i.has_alpha));
        Self { texture: source.image, alpha: source.alpha, key: info.map(|i| i.key), width, height, has_alpha }
    }

    pub fn source(&self) -> TextureSource {
        TextureSource { image: self.texture.clone(), alpha: self.alpha.clone() }
    }

    pub fn info(&self) -> Option<TextureInfo> {
        self.key.map(|key| TextureInfo { key, width: self.width, height: self.height, has_alpha: self.has_alpha })
    }
}

/// Triangles of an asset in a cell of the counting level, and the sum of their hashes modulo 2^128, which does not depend on their order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct CellSum {
    pub cell: u32,
    pub count: u32,
    pub sum: [u64; 2],
}

impl CellSum {
    pub fn value(&self) -> u128 {
        u128::from(self.sum[0]) | u128::from(self.sum[1]) << 64
    }
}

/// Collects the sums of cells.
#[derive(Default)]
pub(crate) struct CellSums(HashMap<u32, (u32, u128)>);

impl CellSums {
    pub fn add(&mut self, cell: u32, t: &BuildTriangle, material: u64) {
        let slot = self.0.entry(cell).or_default();
        slot.0 = slot.0.saturating_add(1);
        slot.1 = slot.1.wrapping_add(triangle_hash(t, material));
    }

    pub fn finish(self) -> Vec<CellSum> {
        let mut out: Vec<CellSum> = self.0.into_iter().map(|(cell, (count, sum))| CellSum { cell, count, sum: halves(sum) }).collect();
        out.sort_unstable_by_key(|c| c.cell);
        out
    }
}

pub(crate) fn halves(v: u128) -> [u64; 2] {
    [v as u64, (v >> 64) as u64]
}

pub(crate) fn record_hash(record: &MaterialRecord) -> u64 {
    XxHash3_64::oneshot(bytemuck::bytes_of(record))
}

/// Hashes everything that a chunk stores of a triangle, except numbers that are valid only within a build.
fn triangle_hash(t: &BuildTriangle, material: u64) -> u128 {
    let plain = BuildTriangle { material: 0, asset: 0, ..*t };
    XxHash3_128::oneshot_with_seed(material, bytemuck::bytes_of(&plain))
}

/// A `GroundLevel`: its box as bits, low and high corner; rows of its lows.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct LevelDocument {
    bounds: [u64; 6],
    has_terrain: bool,
    grounds: Vec<(i64, u64, u64)>,
    lows: Vec<(i64, u64, u64)>,
}

impl GroundLevel {
    pub fn to_document(&self) -> LevelDocument {
        let (lo, hi) = (self.bounds.lo.map(f64::to_bits), self.bounds.hi.map(f64::to_bits));
        let bounds = [lo[0], lo[1], lo[2], hi[0], hi[1], hi[2]];
        LevelDocument { bounds, has_terrain: self.has_terrain, grounds: self.grounds.rows(), lows: self.lows.rows() }
    }

    pub fn from_document(document: &LevelDocument) -> Self {
        let at = |k: usize| f64::from_bits(document.bounds[k]);
        let bounds = Box3 { lo: [at(0), at(1), at(2)], hi: [at(3), at(4), at(5)] };
        let (grounds, lows) = (Lows::from_rows(&document.grounds), Lows::from_rows(&document.lows));
        Self { bounds, has_terrain: document.has_terrain, grounds, lows }
    }
}

impl AssetSummary {
    /// Reads a summary; `None` when it is absent or cannot be read: the asset is then read again.
    pub fn read(path: &Path) -> Option<Self> {
        let bytes = std::fs::read(path).ok()?;
        file::check_header(path, &bytes, MAGIC, VERSION, true).ok()?;
        let count = |at: usize| usize::try_from(u64::from_le_bytes(bytes[at..at + 8].try_into().expect("8 bytes"))).ok();
        let (text, cells, instances, ids) = (count(16)?, count(24)?, count(32)?, count(40)?);
        let cells_at = HEADER_BYTES + aligned(text);
        let instances_at = cells_at + aligned(cells.checked_mul(size_of::<CellSum>())?);
        let ids_at = instances_at.checked_add(aligned(instances.checked_mul(size_of::<InstanceRecord>())?))?;
        let details = serde_json::from_slice(bytes.get(HEADER_BYTES..HEADER_BYTES.checked_add(text)?)?).ok()?;
        let (cells, instances) = (records(&bytes, cells_at, cells)?, records(&bytes, instances_at, instances)?);
        Some(Self { details, cells, instances, ids: records(&bytes, ids_at, ids)? })
    }

    /// Writes a summary without syncing it to the disk: the next build repeats a lost or torn one.
    pub fn write(&self, path: &Path) -> Result<()> {
        let text = serde_json::to_vec(&self.details).expect("details are plain data");
        let mut bytes = vec![0; HEADER_BYTES];
        for section in [&text[..], bytemuck::cast_slice(&self.cells), bytemuck::cast_slice(&self.instances), bytemuck::cast_slice(&self.ids)] {
            bytes.extend_from_slice(section);
            bytes.resize(aligned(bytes.len()), 0);
        }
        let counts = [text.len(), self.cells.len(), self.instances.len(), self.ids.len()].map(|n| (n as u64).to_le_bytes());
        bytes[16..48].copy_from_slice(counts.as_flattened());
        let start = header_start(MAGIC, VERSION, file::checksum(&bytes[HEADER_BYTES..]));
        bytes[..16].copy_from_slice(&start);
        let io = |e| Error::storage(path, e);
        std::fs::create_dir_all(path.parent().unwrap_or(path)).map_err(io)?;
        let part = path.with_extension("part");
        std::fs::write(&part, &bytes).and_then(|()| std::fs::rename(&part, path)).map_err(io)
    }
}

fn records<T: Pod>(bytes: &[u8], at: usize, count: usize) -> Option<Vec<T>> {
    let end = at.checked_add(count.checked_mul(size_of::<T>())?)?;
    Some(bytes.get(at..end)?.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_summary_survives_a_round_trip_and_a_damaged_one_is_rejected() {
        let path = std::env::temp_dir().join(format!("map3d-summary-{}", std::process::id())).join("a.m3v");
        let mut level = GroundLevel::new();
        level.bounds.add_point([1.0 / 3.0, -2e7 / 7.0, 3.0]);
        level.lows.add(-3.0);
        let details = AssetDetails { digest: "m".into(), level: level.to_document(), materials: vec![7, u64::MAX], ..AssetDetails::default() };
        let cell = CellSum { cell: 5, count: 6, sum: [7, 8] };
        let instance = InstanceRecord { object_id: 9, ..InstanceRecord::zeroed() };
        let summary = AssetSummary { details, cells: vec![cell], instances: vec![instance], ids: vec![9, 3] };
        summary.write(&path).expect("write");
        let back = AssetSummary::read(&path).expect("read");
        assert_eq!((&back.cells, &back.instances, &back.ids), (&summary.cells, &summary.instances, &summary.ids));
        assert_eq!(back.details.materials, [7, u64::MAX]);
        let found = GroundLevel::from_document(&back.details.level);
        assert_eq!((found.bounds.lo, found.grounds.lowest_m(), found.lows.lowest_m()), (level.bounds.lo, None, Some(-3.0)));
        let good = std::fs::read(&path).expect("read");
        for cut in [0, 10, 64, 100, good.len() - 1] {
            std::fs::write(&path, &good[..cut]).expect("write");
            assert!(AssetSummary::read(&path).is_none(), "cut at {cut}");
        }
        std::fs::remove_dir_all(path.parent().expect("a folder")).expect("remove");
        assert!(AssetSummary::read(&path).is_none());
    }

    #[test]
    fn sums_depend_on_every_triangle_and_material_but_not_on_order() {
        let at = |x: i64| BuildTriangle { corners: [[x, 0, 0], [x, 1, 0], [x, 0, 1]], ..BuildTriangle::zeroed() };
        let sum = |all: &[(i64, u64)]| {
            let mut sums = CellSums::default();
            all.iter().for_each(|(x, m)| sums.add(3, &at(*x), *m));
            sums.finish()
        };
        assert_eq!(sum(&[(1, 0), (2, 0)]), sum(&[(2, 0), (1, 0)]));
        assert_ne!(sum(&[(1, 0), (2, 0)]), sum(&[(1, 0), (2, 1)]));
        assert_ne!(sum(&[(1, 0), (2, 0)]), sum(&[(1, 0), (1, 0)]));
    }
}
