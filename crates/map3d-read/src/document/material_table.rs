//! The document's material table: equal materials are stored once.

use std::collections::HashMap;

use map3d_base::asset::{Material, SurfaceClass, Wrap};

/// The properties by which two materials are compared: all but the name. Floats are compared by their bits.
#[derive(Clone, PartialEq, Eq, Hash)]
struct MaterialKey {
    diffuse: [u32; 4],
    surface: Option<SurfaceClass>,
    texture: Option<String>,
    alpha: Option<String>,
    wrap: Wrap,
    border: [u32; 4],
}

#[derive(Default)]
pub struct MaterialTable {
    materials: Vec<Material>,
    by_key: HashMap<MaterialKey, u32>,
}

impl MaterialTable {
    pub fn materials(&self) -> &[Material] {
        &self.materials
    }

    /// Returns the index of an equal material, or adds this one. The name of the first of equal materials is kept.
    pub fn add(&mut self, material: Material) -> u32 {
        let key = MaterialKey {
            diffuse: material.diffuse.map(f32::to_bits),
            surface: material.surface,
            texture: material.texture.clone(),
            alpha: material.alpha.clone(),
            wrap: material.wrap,
            border: material.border.map(f32::to_bits),
        };
        *self.by_key.entry(key).or_insert_with(|| {
            self.materials.push(material);
            self.materials.len() as u32 - 1
        })
    }
}

/// Shifts a triangle's texture coordinates towards zero by a multiple of the texture's period, then rounds them to float32.
/// The period is 1 for a repeated image and 2 for a mirrored one; other wrap modes do not shift.
pub fn shift_uvs(uvs: [[f64; 2]; 3], wrap: Wrap) -> [[f32; 2]; 3] {
    let period = match wrap {
        Wrap::Wrap => 1.0,
        Wrap::Mirror => 2.0,
        Wrap::Clamp | Wrap::Border | Wrap::None => return uvs.map(|c| c.map(|v| v as f32)),
    };
    let shift = [0, 1].map(|k| (uvs.iter().map(|c| c[k]).fold(f64::INFINITY, f64::min) / period).floor() * period);
    uvs.map(|c| [(c[0] - shift[0]) as f32, (c[1] - shift[1]) as f32])
}
