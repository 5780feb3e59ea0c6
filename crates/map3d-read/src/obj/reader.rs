//! Reads an OBJ line by line: vertices are kept, faces leave in batches.

use std::collections::HashMap;
use std::path::Path;

use map3d_base::asset::{AssetReport, Batch, Instance, Material, Object};
use map3d_base::vec3::normalized;
use map3d_base::{Error, Result, Vec3};

use super::face::{Corner, Counts, parse_face};
use super::lines::{Lines, numbers, split_word};
use super::mtl::Library;
use super::palette::{Palette, Skin};
use super::pending::Pending;
use crate::asset_folder::AssetFolder;
use crate::document::DocumentReader;
use crate::image_file::{Texture, Textures};
use crate::materials::{MaterialTable, shifted_uvs};
use crate::options::{ReadOptions, Split, Up};
use crate::report::Log;
use crate::text::name_of;
use crate::triangulate::Triangulator;

const BATCH_TRIANGLES: usize = 1 << 16;
/// Colour of a vertex that has none among others that have.
const NO_COLOR: [u8; 3] = [204; 3];

/// A face that names vertices the file has not given yet.
struct Deferred {
    corners: Vec<Corner>,
    skin: Skin,
    object: u32,
    line: u64,
}

/// Reads OBJ with MTL. Memory: all vertices (24 bytes each, with texture coordinates and normals 8 and 12 more), one batch of faces.
pub struct ObjReader {
    lines: Lines,
    log: Log,
    options: ReadOptions,
    palette: Palette,
    positions: Vec<Vec3>,
    colors: Vec<[u8; 3]>,
    uvs: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
    corners: Vec<Corner>,
    deferred: Vec<Deferred>,
    pending: Pending,
    triangulator: Triangulator,
    ring: Vec<Vec3>,
    skin: Option<Skin>,
    material_name: Option<String>,
    objects: Vec<Object>,
    object_numbers: HashMap<String, u32>,
    group: String,
    triangles: u64,
    at_end: bool,
}

impl ObjReader {
    /// Opens a document; names in it may lead to files in its folder (`options.folder` widens that).
    pub fn open(path: &Path, options: &ReadOptions) -> Result<Self> {
        let folder = AssetFolder::of_document(path, options.folder.as_deref())?;
        let palette = Palette { library: Library::default(), textures: Textures::default(), table: MaterialTable::default(), folder };
        Ok(Self {
            lines: Lines::open(path)?,
            log: Log::new(path, "obj", options.strict),
            options: options.clone(),
            palette,
            positions: Vec::new(),
            colors: Vec::new(),
            uvs: Vec::new(),
            normals: Vec::new(),
            corners: Vec::new(),
            deferred: Vec::new(),
            pending: Pending::default(),
            triangulator: Triangulator::default(),
            ring: Vec::new(),
            skin: None,
            material_name: None,
            objects: Vec::new(),
            object_numbers: HashMap::new(),
            group: String::new(),
            triangles: 0,
            at_end: false,
        })
    }

    fn read_line(&mut self) -> Result<bool> {
        let counts = Counts { positions: self.positions.len(), uvs: self.uvs.len(), normals: self.normals.len() };
        let Some(line) = self.lines.next_line()? else { return Ok(false) };
        let (word, rest) = split_word(line);
        match word {
            b"v" => {
                let values: Vec<f64> = numbers(rest).take(8).collect();
                self.vertex(&values)?;
            }
            b"vt" => {
                let mut values = numbers(rest).map(|v| v as f32);
                self.uvs.push([values.next().unwrap_or(0.0), values.next().unwrap_or(0.0)]);
            }
            b"vn" => {
                let mut values = numbers(rest);
                let n = [0; 3].map(|_| values.next().unwrap_or(0.0));
                self.normals.push(normalized(upright(n, self.options.up)).unwrap_or_default().map(|v| v as f32));
            }
            b"f" | b"fo" => match parse_face(rest, counts, &mut self.corners) {
                Some(()) => self.face()?,
                None => self.skip("face that cannot be read")?,
            },
            b"usemtl" => {
                self.material_name = Some(name_of(rest).into_owned()).filter(|name| !name.is_empty());
                self.skin = None;
            }
            b"mtllib" => self.palette.library.load_statement(rest, &mut self.palette.folder, &mut self.log)?,
            b"o" | b"g" => self.group = name_of(rest).into_owned(),
            b"p" | b"l" => self.log.report.skip("points and lines", 1),
            b"curv" | b"surf" | b"curv2" => self.skip("free-form curve or surface")?,
            _ => {}
        }
        Ok(true)
    }

    fn skip(&mut self, reason: &str) -> Result<()> {
        let line = self.lines.number;
        self.log.skip(reason, || format!("line {line}"))
    }

    /// x y z [w], or x y z and a colour.
    fn vertex(&mut self, values: &[f64]) -> Result<()> {
        let position = match *values {
            [x, y, z, ..] => upright([x, y, z], self.options.up),
            _ => {
                self.skip("vertex that cannot be read")?;
                [f64::NAN; 3]
            }
        };
        if let [_, _, _, r, g, b] | [_, _, _, _, r, g, b] = *values {
            let scale = if r.max(g).max(b) > 1.0 { 1.0 } else { 255.0 };
            self.colors.resize(self.positions.len(), NO_COLOR);
            self.colors.push([r, g, b].map(|v| (v * scale).round() as u8));
        }
        self.positions.push(position);
        Ok(())
    }

    fn face(&mut self) -> Result<()> {
        let skin = match self.skin {
            Some(skin) => skin,
            None => self.palette.skin(self.material_name.as_deref(), &self.options, &mut self.log)?,
        };
        self.skin = Some(skin);
        let object = self.object();
        if self.corners.iter().any(|c| !self.is_known(c)) {
            self.deferred.push(Deferred { corners: self.corners.clone(), skin, object, line: self.lines.number });
            return Ok(());
        }
        self.draw(skin, object, self.lines.number)
    }

    fn is_known(&self, corner: &Corner) -> bool {
        let below = |n: Option<u32>, count: usize| n.is_none_or(|n| (n as usize) < count);
        below(Some(corner.position), self.positions.len()) && below(corner.uv, self.uvs.len()) && below(corner.normal, self.normals.len())
    }

    /// The object that faces belong to now; made when its first face comes.
    fn object(&mut self) -> u32 {
        let name = match self.options.split {
            Split::Group if !self.group.is_empty() => self.group.as_str(),
            _ => "",
        };
        if let Some(number) = self.object_numbers.get(name) {
            return *number;
        }
        let shown = if name.is_empty() { self.log.path().file_stem().unwrap_or_default().to_string_lossy().into_owned() } else { name.to_owned() };
        let number = self.objects.len() as u32;
        self.object_numbers.insert(name.to_owned(), number);
        self.objects.push(Object { name: shown, class: "generic".into(), ..Object::default() });
        number
    }

    /// Triangulates `self.corners`.
    fn draw(&mut self, skin: Skin, object: u32, line: u64) -> Result<()> {
        let place = || format!("line {line}");
        self.drop_repeated();
        let limit = self.options.max_ring_vertices;
        if self.corners.len() as u64 > limit {
            return self.log.skip(&format!("face over the limit max_ring_vertices = {limit}"), place);
        }
        if self.corners.len() < 3 {
            return self.log.skip("face with fewer than 3 corners", place);
        }
        if skin.invisible {
            self.log.report.skip("fully transparent face", 1);
            return Ok(());
        }
        self.ring.clear();
        self.ring.extend(self.corners.iter().map(|c| self.positions[c.position as usize]));
        match self.triangulator.polygon(&self.ring, &[self.ring.len()]) {
            Err(fault) => return self.log.skip(fault.reason(), place),
            Ok(false) => self.log.warn("face that crosses itself", place())?,
            Ok(true) => {}
        }
        self.push_triangles(skin, object)
    }

    fn push_triangles(&mut self, skin: Skin, object: u32) -> Result<()> {
        let has_uvs = self.corners.iter().all(|c| c.uv.is_some());
        let has_normals = self.corners.iter().all(|c| c.normal.is_some());
        let textured = skin.textured.filter(|_| has_uvs);
        let material = match textured {
            Some(material) => material,
            None if skin.unnamed && !self.colors.is_empty() => {
                let colors = self.corners.iter().map(|c| self.colors.get(c.position as usize).copied().unwrap_or(NO_COLOR));
                self.palette.of_vertex_colors(colors)
            }
            None => skin.plain,
        };
        for t in self.triangulator.triangles().as_chunks::<3>().0 {
            let corners = t.map(|i| self.corners[i as usize]);
            let uvs = textured.map(|_| shifted_uvs(corners.map(|c| skin.uv(self.uvs[c.uv.unwrap_or(0) as usize])), skin.wrap));
            let normals = has_normals.then(|| corners.map(|c| self.normals[c.normal.unwrap_or(0) as usize]));
            self.pending.push(&self.positions, corners.map(|c| c.position), material, object, uvs, normals);
        }
        self.count(self.triangulator.triangles().len() as u64 / 3)
    }

    fn count(&mut self, triangles: u64) -> Result<()> {
        self.triangles += triangles;
        let (got, value) = (self.triangles, self.options.max_triangles);
        if got > value {
            return Err(Error::Limit { path: self.log.path().to_path_buf(), what: "number of triangles", got, limit: "max_triangles", value });
        }
        Ok(())
    }

    /// Corners that follow their equal, the first and the last too.
    fn drop_repeated(&mut self) {
        self.corners.dedup_by_key(|c| c.position);
        while self.corners.len() > 1 && self.corners.first().map(|c| c.position) == self.corners.last().map(|c| c.position) {
            self.corners.pop();
        }
    }

    fn draw_deferred(&mut self) -> Result<()> {
        for face in std::mem::take(&mut self.deferred) {
            if !face.corners.iter().all(|c| self.is_known(c)) {
                self.log.skip("index out of range", || format!("line {}", face.line))?;
                continue;
            }
            self.corners = face.corners;
            self.draw(face.skin, face.object, face.line)?;
        }
        Ok(())
    }
}

fn upright([x, y, z]: Vec3, up: Up) -> Vec3 {
    match up {
        Up::Z => [x, y, z],
        Up::Y => [x, -z, y],
    }
}

impl DocumentReader for ObjReader {
    fn next_batch(&mut self) -> Result<Option<Batch>> {
        while !self.at_end && self.pending.triangle_count() < BATCH_TRIANGLES {
            if !self.read_line()? {
                self.at_end = true;
                self.draw_deferred()?;
            }
        }
        Ok((self.pending.triangle_count() > 0).then(|| self.pending.take()))
    }

    fn srs_name(&self) -> Option<&str> {
        None
    }

    fn materials(&self) -> &[Material] {
        self.palette.table.all()
    }

    fn objects(&self) -> &[Object] {
        &self.objects
    }

    fn instances(&self) -> &[Instance] {
        &[]
    }

    fn instances_mut(&mut self) -> &mut [Instance] {
        &mut []
    }

    fn textures(&self) -> &[Texture] {
        self.palette.textures.files()
    }

    fn report(&self) -> &AssetReport {
        &self.log.report
    }
}
