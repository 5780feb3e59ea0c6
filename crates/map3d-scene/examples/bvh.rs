//! `bvh CHUNK…`: rebuilds the BVH of chunk files; prints CPU seconds per million triangles and bytes per triangle.

use std::path::Path;

use map3d_scene::Chunk;
use map3d_scene::bvh::{self, Aabb};

fn main() {
    let (mut seconds, mut items, mut tree_bytes, mut file_bytes) = (0.0, 0usize, 0usize, 0usize);
    for path in std::env::args().skip(1) {
        let chunk = Chunk::open(Path::new(&path), false).expect("a chunk");
        let mut boxes = vec![Aabb::EMPTY; chunk.triangles().len()];
        for leaf in chunk.leaves() {
            for lane in (0..8).take_while(|lane| leaf.triangle[*lane] != u32::MAX) {
                let corner = |c: usize| [0, 1, 2].map(|k| leaf.corners[3 * c + k][lane]);
                boxes[leaf.triangle[lane] as usize] = Aabb::of_points(&[corner(0), corner(1), corner(2)]);
            }
        }
        let begun = cpu_s();
        let tree = bvh::build(&boxes);
        seconds += cpu_s() - begun;
        items += boxes.len();
        tree_bytes += tree.nodes.len() * 256 + tree.leaves.len() * 320;
        file_bytes += chunk.bytes();
    }
    let each = |bytes: usize| bytes as f64 / items as f64;
    println!(
        "{items} triangles: {:.3} s a million, tree with positions {:.1} bytes a triangle, file {:.1}",
        seconds / items as f64 * 1e6,
        each(tree_bytes),
        each(file_bytes)
    );
}

/// Returns the CPU seconds of this thread (Linux).
fn cpu_s() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    text.split(' ').next().and_then(|ns| ns.parse::<f64>().ok()).unwrap_or(f64::NAN) * 1e-9
}
