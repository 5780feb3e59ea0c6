//! Counts vertices that are equal after snapping, in bounded memory: positions are hashed, and counted in as many passes as the memory asks for.

use map3d_base::asset::AssetMesh;
use map3d_base::{Vec3, vec3};
use twox_hash::XxHash3_64;

use crate::lattice::snap;

/// Vertices less, if equal ones were one. `memory_bytes` bounds what is held at a time.
pub(super) fn duplicate_vertices(mesh: &AssetMesh, origin: Vec3, memory_bytes: u64) -> u64 {
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
