//! The table of materials: equal ones are stored once.

use std::collections::HashMap;

use map3d_base::asset::{Material, Wrap};

/// Everything that makes two materials differ in a picture.
#[derive(Clone, PartialEq, Eq, Hash)]
struct Look {
    diffuse: [u32; 4],
    texture: Option<String>,
    alpha: Option<String>,
    wrap: Wrap,
    border: [u32; 4],
}

#[derive(Default)]
pub struct MaterialTable {
    materials: Vec<Material>,
    by_look: HashMap<Look, u32>,
}

impl MaterialTable {
    pub fn all(&self) -> &[Material] {
        &self.materials
    }

    /// Index of a material that looks like this; the first one's name is kept.
    pub fn index_of(&mut self, material: Material) -> u32 {
        let look = Look {
            diffuse: material.diffuse.map(f32::to_bits),
            texture: material.texture.clone(),
            alpha: material.alpha.clone(),
            wrap: material.wrap,
            border: material.border.map(f32::to_bits),
        };
        *self.by_look.entry(look).or_insert_with(|| {
            self.materials.push(material);
            self.materials.len() as u32 - 1
        })
    }
}

/// Subtracts from a triangle's texture coordinates (float64, before they lose digits) what its wrap mode lets be subtracted:
/// whole numbers when the image repeats, even ones when it is mirrored, nothing otherwise.
pub fn shifted_uvs(uvs: [[f64; 2]; 3], wrap: Wrap) -> [[f32; 2]; 3] {
    let period = match wrap {
        Wrap::Wrap => 1.0,
        Wrap::Mirror => 2.0,
        Wrap::Clamp | Wrap::Border | Wrap::None => return uvs.map(|c| c.map(|v| v as f32)),
    };
    let shift = [0, 1].map(|k| (uvs.iter().map(|c| c[k]).fold(f64::INFINITY, f64::min) / period).floor() * period);
    uvs.map(|c| [(c[0] - shift[0]) as f32, (c[1] - shift[1]) as f32])
}
