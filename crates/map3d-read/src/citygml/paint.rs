//! From surface data to materials and texture coordinates.

use std::fs;

use map3d_base::asset::{Material, Wrap};
use map3d_base::{Result, Vec3};

use super::appearance::{Appearances, Binding, Look, Mapping, Placement, Ready};
use super::georeference::Georeference;
use super::ids::Id;
use super::kinds::default_color;
use crate::asset_folder::AssetFolder;
use crate::image_file::Textures;
use crate::materials::MaterialTable;
use crate::options::ReadOptions;
use crate::report::Log;

pub struct Painter {
    pub textures: Textures,
    pub table: MaterialTable,
    pub folder: AssetFolder,
    pub options: ReadOptions,
}

/// One ring of a polygon as it was written.
#[derive(Clone, Copy)]
pub struct RingPoints<'a> {
    pub id: Id,
    pub points: &'a [Vec3],
}

/// How a polygon is painted; texture coordinates stand in the buffer that was passed, one for each point as written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Paint {
    pub material: u32,
    pub wrap: Wrap,
    pub textured: bool,
    pub invisible: bool,
}

impl Painter {
    /// Looks for the nearest texture along `chain` (ids from the polygon upwards), then for the nearest colour, in all stores.
    pub fn paint(
        &mut self,
        chain: &[Id],
        rings: &[RingPoints],
        stores: &mut [&mut Appearances],
        uvs: &mut Vec<[f64; 2]>,
        log: &mut Log,
    ) -> Result<Option<Paint>> {
        let mut color = None;
        for id in chain {
            for store in stores.iter_mut().filter(|s| !s.is_empty()) {
                let bindings: Vec<Binding> = store.of_target(*id).filter(|b| store.data[b.data as usize].front).collect();
                for binding in bindings {
                    let Some(ready) = self.ready(store, binding.data, log)? else { continue };
                    if !ready.textured {
                        color.get_or_insert(ready);
                    } else if map_rings(store, binding.mapping, &ready, rings, uvs, log)? {
                        return Ok(Some(paint_of(ready)));
                    }
                }
            }
        }
        Ok(color.map(paint_of))
    }

    /// The material of a surface for which the document gives none.
    pub fn default_paint(&mut self, locals: [&str; 2]) -> Paint {
        let material = match locals.into_iter().find_map(default_color) {
            Some((name, [r, g, b])) => Material { name: name.into(), diffuse: [r, g, b, 1.0], ..Material::default() },
            None => Material { name: "default".into(), ..Material::default() },
        };
        Paint { material: self.table.index_of(material), wrap: Wrap::Wrap, textured: false, invisible: false }
    }

    fn ready(&mut self, store: &mut Appearances, number: u32, log: &mut Log) -> Result<Option<Ready>> {
        let data = &store.data[number as usize];
        if let Some(ready) = data.ready {
            return Ok(ready);
        }
        let look = data.look.clone();
        let ready = match look {
            Look::Nothing => None,
            Look::Color(diffuse) => Some(self.color(diffuse)),
            Look::Texture { image, wrap, border, placed } => self.texture(&image, wrap, border, placed, log)?,
        };
        store.data[number as usize].ready = Some(ready);
        Ok(ready)
    }

    fn color(&mut self, diffuse: [f32; 4]) -> Ready {
        let material = self.table.index_of(Material { name: "X3DMaterial".into(), diffuse, ..Material::default() });
        Ready { material, wrap: Wrap::Wrap, textured: false, invisible: diffuse[3] <= 0.0, world: None, size_px: [0; 2] }
    }

    fn texture(&mut self, image: &str, wrap: Wrap, border: [f32; 4], placed: Placement, log: &mut Log) -> Result<Option<Ready>> {
        let Some(texture) = self.textures.get(image, &mut self.folder, &self.options, log)?.cloned() else { return Ok(None) };
        let world = match placed {
            Placement::ByTarget => None,
            Placement::World(world) => Some(world),
            Placement::WorldFile => match self.world_file(image, log)? {
                None => return Ok(None),
                found => found,
            },
        };
        let border = if wrap == Wrap::Border { border } else { [0.0; 4] };
        let material = Material {
            name: image.to_owned(),
            diffuse: [1.0; 4],
            texture: Some(texture.key),
            wrap,
            border,
            cutout: texture.transparent || (wrap == Wrap::Border && border[3] < 0.5),
            ..Material::default()
        };
        let size_px = [texture.width_px, texture.height_px];
        Ok(Some(Ready { material: self.table.index_of(material), wrap, textured: true, invisible: false, world, size_px }))
    }

    /// Beside `a.tif`: `a.tfw`, `a.tifw` or `a.wld`.
    fn world_file(&mut self, image: &str, log: &mut Log) -> Result<Option<Georeference>> {
        let (stem, extension) = image.rsplit_once('.').unwrap_or((image, ""));
        let letters: Vec<char> = extension.chars().collect();
        let short: String = letters.first().into_iter().chain(letters.last()).chain(&['w']).collect();
        let names = [format!("{stem}.{short}"), format!("{stem}.{extension}w"), format!("{stem}.wld")];
        let found = names.iter().find_map(|name| self.folder.find(name).ok());
        let world = found.and_then(|f| fs::read_to_string(f.path).ok()).and_then(|text| Georeference::from_world_file(&text));
        if world.is_none() {
            log.warn("georeferenced texture without reference point or world file", image)?;
        }
        Ok(world)
    }
}

fn paint_of(ready: Ready) -> Paint {
    Paint { material: ready.material, wrap: ready.wrap, textured: ready.textured, invisible: ready.invisible }
}

/// Fills `uvs`, one for each point of all rings. False: this mapping has none for this polygon.
fn map_rings(store: &Appearances, mapping: Mapping, ready: &Ready, rings: &[RingPoints], uvs: &mut Vec<[f64; 2]>, log: &mut Log) -> Result<bool> {
    uvs.clear();
    let all = || rings.iter().flat_map(|r| r.points);
    if let Some(world) = ready.world {
        uvs.extend(all().map(|p| world.uv(*p, ready.size_px[0], ready.size_px[1])));
        return Ok(true);
    }
    match store.mapping(mapping) {
        Mapping::Matrix(matrix) => {
            uvs.extend(all().map(|p| store.project(matrix, *p)));
            Ok(true)
        }
        Mapping::Rings { first, count } => map_listed(store, first, count, rings, uvs, log),
        Mapping::None | Mapping::Named(_) => {
            log.warn("texture without a mapping", String::new())?;
            Ok(false)
        }
    }
}

fn map_listed(store: &Appearances, first: u32, count: u32, rings: &[RingPoints], uvs: &mut Vec<[f64; 2]>, log: &mut Log) -> Result<bool> {
    for (k, ring) in rings.iter().enumerate() {
        let Some(found) = store.uvs_of_ring(first, count, ring.id) else {
            // The list is for other polygons of the target, or it forgot one of the rings.
            if k > 0 {
                log.warn("texture without coordinates for a hole", String::new())?;
            }
            return Ok(false);
        };
        let as_f64 = |uv: &[f32; 2]| uv.map(f64::from);
        uvs.extend(found.iter().take(ring.points.len()).map(as_f64));
        match ring.points.len().saturating_sub(found.len()) {
            0 => {}
            1 if !found.is_empty() => uvs.push(as_f64(&found[0])),
            _ => {
                log.warn("texture coordinates fewer than points", format!("{} for {}", found.len(), ring.points.len()))?;
                return Ok(false);
            }
        }
    }
    Ok(true)
}
