//! Summarizes an asset: measures it, counts what the build optimises away and writes its prototypes.

use std::path::Path;

use map3d_base::asset::AssetMesh;
use map3d_base::{Error, Result, Vec3, vec3};
use map3d_scene::lattice::{metres, snap};
use map3d_texture::TextureKeys;
use twox_hash::XxHash3_64;

use crate::asset_summary::{AssetDetails, AssetSummary, SummaryTexture};
use crate::chunk_cache::CHUNKS;
use crate::files::write_if_changed;
use crate::ground::GroundLevel;
use crate::triangle::BuildTriangle;
use crate::triangle_source::TriangleSource;
use crate::{BuildReport, BuildRequest, prototypes, textures};

/// Summarizes an asset except for its cells; writes its prototypes.
pub(crate) fn summarize_asset(
    folder: &Path,
    request: &BuildRequest,
    source: &TriangleSource,
    number: usize,
    textures: &TextureKeys,
    keep_going: &mut dyn FnMut(u64) -> bool,
) -> Result<AssetSummary> {
    let asset = source.assets[number];
    let (mut counts, mut level) = (BuildReport::default(), GroundLevel::new());
    let several = source.extent.filter(|e| e.regions.len() > 1);
    let mut levels = vec![GroundLevel::new(); several.map_or(0, |e| e.regions.len())];
    let mut put = |_: u32, t: &BuildTriangle| {
        level.add_triangle(t);
        if let Some(extent) = several {
            levels[extent.region_of(t.corners.map(|c| vec3::add(metres(c), source.origin)))].add_triangle(t);
        }
    };
    if !source.stream(number, |p| p == 0, &mut counts, &mut put, keep_going) {
        return Err(Error::Interrupted);
    }
    let collected = prototypes::collect(source, number, &mut counts, keep_going).ok_or(Error::Interrupted)?;
    let instances = prototypes::instances(source, number, &collected, &mut counts);
    let mut files = Vec::new();
    for triangles in collected.values() {
        let chunk = prototypes::encode(triangles, source)?;
        let file = format!("{CHUNKS}/p_{:016x}.m3c", chunk.hash);
        write_if_changed(&folder.join(&file), &chunk.bytes)?;
        counts.duplicate_faces += triangles.len() as u64 - chunk.triangles;
        files.push(file);
    }
    if request.options.merge_vertices {
        counts.duplicate_vertices = duplicate_vertices(&asset.mesh, request.origin, request.memory_bytes() / 4);
    }
    counts.materials_without_their_texture = source.materials.without_their_texture[number];
    let known = textures::used_sources(asset).into_iter().map(|s| SummaryTexture::new(s.clone(), textures.by_source.get(&s)));
    let (textures, materials) = (known.collect(), source.materials.hashes_of(number));
    let levels = levels.iter().map(GroundLevel::to_document).collect();
    let details = AssetDetails { level: level.to_document(), levels, counts, textures, materials, prototypes: files, ..AssetDetails::default() };
    Ok(AssetSummary { details, cells: Vec::new(), instances, ids: asset.ids.clone() })
}

/// Returns the number of vertices that equal another one after snapping. Bounds memory by hashing positions in as many passes as needed.
fn duplicate_vertices(mesh: &AssetMesh, origin: Vec3, memory_bytes: u64) -> u64 {
    let positions = mesh.positions();
    let passes = (positions.len() as u64 * 8).div_ceil(memory_bytes.max(1 << 20)).max(1);
    let unique: u64 = (0..passes).map(|pass| unique_in_pass(mesh, origin, pass, passes)).sum();
    positions.len() as u64 - unique
}

fn unique_in_pass(mesh: &AssetMesh, origin: Vec3, pass: u64, passes: u64) -> u64 {
    let hash = |p: &Vec3| XxHash3_64::oneshot(bytemuck::bytes_of(&snap(vec3::sub(*p, origin))));
    let positions = mesh.pieces(mesh.positions()).flatten();
    let mut hashes: Vec<u64> = positions.map(hash).filter(|h| h % passes == pass).collect();
    hashes.sort_unstable();
    hashes.dedup();
    hashes.len() as u64
}
