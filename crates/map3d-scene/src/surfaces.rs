//! Samples of the surfaces of a built scene: how large triangles and texels are.

use std::collections::HashMap;

use map3d_base::{Result, vec3};
use map3d_texture::{TextureFile, texture_path};

use crate::chunk::Chunk;
use crate::records::MaterialRecord;
use crate::store::SceneStore;

const PARTS: usize = 64;
const LEAVES_OF_A_PART: usize = 512;

/// A sampled triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceSample {
    /// Id of the object.
    pub object: u32,
    pub area_m2: f64,
    /// Side of a texel; `None` without a texture.
    pub texel_m: Option<f64>,
}

impl SceneStore {
    /// Returns triangles evenly spread over all chunks and prototypes; always the same ones. At most 262,144.
    pub fn sample_surfaces(&self) -> Result<Vec<SurfaceSample>> {
        let (mut out, mut sizes) = (Vec::new(), HashMap::new());
        let count = self.index().chunks.len() + self.index().prototypes.len();
        for number in (0..count).step_by(count.div_ceil(PARTS).max(1)) {
            self.sample_chunk(&*self.chunk(number as u32)?, &mut sizes, &mut out);
        }
        Ok(out)
    }

    fn sample_chunk(&self, chunk: &Chunk, sizes: &mut HashMap<[u8; 16], Option<[f64; 2]>>, out: &mut Vec<SurfaceSample>) {
        let leaves = chunk.leaves();
        for leaf in leaves.iter().step_by(leaves.len().div_ceil(LEAVES_OF_A_PART).max(1)) {
            for lane in (0..8).filter(|lane| (leaf.triangle[*lane] as usize) < chunk.triangles().len()) {
                let record = &chunk.triangles()[leaf.triangle[lane] as usize];
                let corners = [0, 1, 2].map(|c| [0, 1, 2].map(|k| f64::from(leaf.corners[3 * c + k][lane])));
                let area_m2 = vec3::length(vec3::triangle_normal(corners)) / 2.0;
                let size = self.texture_size(&chunk.materials()[record.material as usize], sizes);
                let texel_m = size.and_then(|size| texel_m(area_m2, record.uv, size));
                out.push(SurfaceSample { object: chunk.objects()[record.object as usize].id, area_m2, texel_m });
            }
        }
    }

    /// Returns width and height of a material's texture; `None` without a texture that can be read.
    fn texture_size(&self, material: &MaterialRecord, sizes: &mut HashMap<[u8; 16], Option<[f64; 2]>>) -> Option<[f64; 2]> {
        let key = material.texture_key()?;
        *sizes.entry(key).or_insert_with(|| {
            let file = TextureFile::open_header(&texture_path(&self.folder().join("textures"), &key)).ok()?;
            Some([f64::from(file.width), f64::from(file.height)])
        })
    }
}

/// Returns the side of a square texel of the same area.
fn texel_m(area_m2: f64, uv: [[f32; 2]; 3], [width, height]: [f64; 2]) -> Option<f64> {
    let edge = |k: usize| [0, 1].map(|i| f64::from(uv[k][i] - uv[0][i]));
    let (a, b) = (edge(1), edge(2));
    let texels = (a[0] * b[1] - a[1] * b[0]).abs() / 2.0 * width * height;
    (texels > 0.0 && area_m2 > 0.0).then(|| (area_m2 / texels).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_texel_covers_its_share_of_the_triangle() {
        let uv = [[0.0, 0.0], [0.5, 0.0], [0.0, 0.25]];
        assert_eq!(texel_m(50.0, uv, [200.0, 100.0]), Some((50.0_f64 / 1250.0 * 1.0).sqrt()));
        assert_eq!(texel_m(50.0, [[0.0; 2]; 3], [200.0, 100.0]), None);
    }
}
