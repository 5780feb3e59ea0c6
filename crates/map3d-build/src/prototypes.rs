//! Converts prototypes to chunks in their own frames, and their placements to instance records.

use std::collections::{BTreeMap, BTreeSet};

use map3d_base::{Box3, Result, Vec3};
use map3d_scene::index::ChunkEntry;
use map3d_scene::lattice::Point;
use map3d_scene::records::InstanceRecord;
use twox_hash::XxHash3_128;

use crate::encode::{ChunkFile, ChunkInput, content_hash, encode_chunk};
use crate::report::BuildReport;
use crate::triangle::BuildTriangle;
use crate::triangle_source::TriangleSource;

/// Triangles by the asset's prototype number; ordered, so that every build numbers them alike.
pub(crate) type Prototypes = BTreeMap<u32, Vec<BuildTriangle>>;

/// Collects the prototypes of an asset that have instances; `None` when `keep_going` returned false.
pub(crate) fn collect(
    source: &TriangleSource,
    number: usize,
    report: &mut BuildReport,
    keep_going: &mut dyn FnMut(u64) -> bool,
) -> Option<Prototypes> {
    let mut out = Prototypes::new();
    let asset = source.assets[number];
    if asset.instances.is_empty() {
        return Some(out);
    }
    let placed: BTreeSet<u32> = asset.instances.iter().map(|i| i.prototype).collect();
    let mut put = |prototype: u32, t: &BuildTriangle| out.entry(prototype).or_default().push(*t);
    source.stream(number, |p| p > 0 && placed.contains(&p), report, &mut put, keep_going).then_some(out)
}

/// Encodes the chunk of a prototype; its origin is the middle of its box.
pub(crate) fn encode(triangles: &[BuildTriangle], source: &TriangleSource) -> Result<ChunkFile> {
    let corners = || triangles.iter().flat_map(|t| t.corners);
    let middle = |k: usize| {
        let (lo, hi) = (corners().map(|c| c[k]).min().unwrap_or(0), corners().map(|c| c[k]).max().unwrap_or(0));
        lo + (hi - lo) / 2
    };
    let origin: Point = [middle(0), middle(1), middle(2)];
    encode_chunk(triangles.to_vec(), origin, &source.materials.records, source.options.merge_faces, ChunkInput::default())
}

/// Returns the instances of an asset's prototypes that have triangles, in the order of the asset; `prototype` is an index into `prototypes`.
pub(crate) fn instances(source: &TriangleSource, number: usize, prototypes: &Prototypes, report: &mut BuildReport) -> Vec<InstanceRecord> {
    let known: BTreeMap<u32, (u32, [u64; 2])> =
        prototypes.iter().zip(0..).map(|((key, t), k)| (*key, (k, content_hash(t, &source.materials.records)))).collect();
    let asset = source.assets[number];
    let mut out = Vec::new();
    for instance in &asset.instances {
        let Some((prototype, content)) = known.get(&instance.prototype) else {
            report.instances_of_nothing += 1;
            continue;
        };
        let Some(transform) = asset.mesh.placed(instance.object, &instance.transform) else {
            report.adjusted_away += 1;
            continue;
        };
        if source.extent.is_some_and(|e| !e.keeps_point([3, 7, 11].map(|k| transform[k]))) {
            report.outlier_triangles += 1;
            continue;
        }
        let transform = to_local(&transform, source.origin);
        let object_id = asset.ids[instance.object as usize];
        let content = instance_hash(content, object_id, &transform);
        out.push(InstanceRecord { prototype: *prototype, object_id, transform, content, reserved: 0 });
    }
    out
}

fn to_local(transform: &[f64; 12], origin: Vec3) -> [f64; 12] {
    let mut out = *transform;
    (0..3).for_each(|k| out[4 * k + 3] -= origin[k]);
    out
}

fn instance_hash(content: &[u64; 2], object_id: u32, transform: &[f64; 12]) -> [u64; 2] {
    let mut hash = XxHash3_128::with_seed(0);
    hash.write(bytemuck::bytes_of(content));
    hash.write(&object_id.to_le_bytes());
    hash.write(bytemuck::bytes_of(transform));
    let value = hash.finish_128();
    [value as u64, (value >> 64) as u64]
}

/// Returns the local box of all instances.
pub(crate) fn placed_bounds(records: &[InstanceRecord], entries: &[ChunkEntry]) -> Box3 {
    let boxes: Vec<Box3> = entries.iter().map(ChunkEntry::box3).collect();
    let mut out = Box3::EMPTY;
    records.iter().for_each(|r| out.add_box(&map3d_scene::instances::placed_box(&r.transform, &boxes[r.prototype as usize])));
    out
}
