//! Reads an OBJ line by line: keeps all vertices, returns faces in batches.

use std::collections::HashMap;
use std::path::Path;

use map3d_base::asset::{AssetReport, Batch, Instance, Material, Object};
use map3d_base::vec3::normalized;
use map3d_base::{Reason, Result, Vec3};

use super::batch_builder::{BatchBuilder, FaceTriangle};
use super::face::{ElementCounts, FaceVertex, parse_face};
use super::face_material::{FaceMaterial, FaceMaterialResolver};
use super::line_reader::{LineReader, numbers, split_word};
use super::options::{ObjOptions, Split, Up};
use crate::document::DocumentReader;
use crate::document::asset_folder::AssetFolder;
use crate::document::images::DocumentImage;
use crate::document::material_table::shift_uvs;
use crate::document::options::ReadOptions;
use crate::document::report_builder::{LimitCheck, ReportBuilder};
use crate::document::text_input::decode_name;
use crate::document::transparency::report_invisible;
use crate::triangulation::triangulate::{Coverage, Triangulator};

pub const NAME: &str = "obj";
const BATCH_TRIANGLES: usize = 1 << 16;
/// Colour of a vertex without a colour, in a document that has vertex colours.
const DEFAULT_VERTEX_COLOR: [u8; 3] = [204; 3];

/// A face that refers to vertices that the file has not defined yet.
struct DeferredFace {
    vertices: Vec<FaceVertex>,
    material: FaceMaterial,
    object: u32,
    line: u64,
}

/// Reads OBJ with MTL. Memory: all vertices (24 bytes per position, 8 per texture coordinate, 12 per normal) and one batch of faces.
pub struct ObjReader {
    lines: LineReader,
    report: ReportBuilder,
    options: ReadOptions,
    of_format: ObjOptions,
    materials: FaceMaterialResolver,
    positions: Vec<Vec3>,
    colors: Vec<[u8; 3]>,
    uvs: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
    /// Vertices of the current face.
    face: Vec<FaceVertex>,
    deferred: Vec<DeferredFace>,
    batch: BatchBuilder,
    triangulator: Triangulator,
    ring: Vec<Vec3>,
    /// The resolved `material_name`; `None` until a face uses it.
    material: Option<FaceMaterial>,
    material_name: Option<String>,
    objects: Vec<Object>,
    object_numbers: HashMap<String, u32>,
    group: String,
    /// None: OBJ has no instances.
    instances: Vec<Instance>,
    triangles: u64,
    at_end: bool,
}

impl ObjReader {
    /// Opens a document. File names in it are resolved inside its folder, or inside `options.folder`.
    pub fn open(path: &Path, options: &ReadOptions) -> Result<Self> {
        let folder = AssetFolder::for_document(path, options.folder.as_deref())?;
        Ok(Self {
            lines: LineReader::open(path)?,
            report: ReportBuilder::new(path, NAME, options.strict),
            options: options.clone(),
            of_format: options.parse_of_format()?,
            materials: FaceMaterialResolver::new(folder, options.transparency),
            positions: Vec::new(),
            colors: Vec::new(),
            uvs: Vec::new(),
            normals: Vec::new(),
            face: Vec::new(),
            deferred: Vec::new(),
            batch: BatchBuilder::default(),
            triangulator: Triangulator::default(),
            ring: Vec::new(),
            material: None,
            material_name: None,
            objects: Vec::new(),
            object_numbers: HashMap::new(),
            group: String::new(),
            instances: Vec::new(),
            triangles: 0,
            at_end: false,
        })
    }

    /// Reads one line; returns false at the end of the file.
    fn read_line(&mut self) -> Result<bool> {
        let counts = ElementCounts { positions: self.positions.len(), uvs: self.uvs.len(), normals: self.normals.len() };
        let Some(line) = self.lines.next_line()? else { return Ok(false) };
        let (word, rest) = split_word(line);
        match word {
            b"v" => {
                let values: Vec<f64> = numbers(rest).take(8).collect();
                self.add_vertex(&values)?;
            }
            b"vt" => {
                let mut values = numbers(rest).map(|v| v as f32);
                self.uvs.push([values.next().unwrap_or(0.0), values.next().unwrap_or(0.0)]);
            }
            b"vn" => {
                let mut values = numbers(rest);
                let n = [0; 3].map(|_| values.next().unwrap_or(0.0));
                self.normals.push(normalized(convert_to_z_up(n, self.of_format.up)).unwrap_or_default().map(|v| v as f32));
            }
            b"f" | b"fo" => match parse_face(rest, counts, &mut self.face) {
                Some(()) => self.add_face()?,
                None => self.skip(Reason::FaceUnreadable)?,
            },
            b"usemtl" => {
                self.material_name = Some(decode_name(rest).into_owned()).filter(|name| !name.is_empty());
                self.material = None;
            }
            b"mtllib" => self.materials.library.load_statement(rest, &mut self.materials.folder, &mut self.report)?,
            b"o" | b"g" => self.group = decode_name(rest).into_owned(),
            b"p" | b"l" => self.report.omit(Reason::PointsAndLines, 1),
            b"curv" | b"surf" | b"curv2" => self.skip(Reason::FreeFormGeometry)?,
            _ => {}
        }
        Ok(true)
    }

    fn skip(&mut self, reason: Reason) -> Result<()> {
        let line = self.lines.line_number;
        self.report.skip(reason, || format!("line {line}"))
    }

    /// Adds a vertex from `x y z [w]` or `x y z [w] r g b`.
    fn add_vertex(&mut self, values: &[f64]) -> Result<()> {
        let position = match *values {
            [x, y, z, ..] => convert_to_z_up([x, y, z], self.of_format.up),
            _ => {
                self.skip(Reason::VertexUnreadable)?;
                [f64::NAN; 3]
            }
        };
        if let [_, _, _, r, g, b] | [_, _, _, _, r, g, b] = *values {
            let scale = if r.max(g).max(b) > 1.0 { 1.0 } else { 255.0 };
            self.colors.resize(self.positions.len(), DEFAULT_VERTEX_COLOR);
            self.colors.push([r, g, b].map(|v| (v * scale).round() as u8));
        }
        self.positions.push(position);
        Ok(())
    }

    /// Triangulates `self.face`, or defers it if it refers to vertices that the file has not defined yet.
    fn add_face(&mut self) -> Result<()> {
        let material = match self.material {
            Some(material) => material,
            None => self.materials.resolve(self.material_name.as_deref(), &self.options, &mut self.report)?,
        };
        self.material = Some(material);
        let object = self.current_object();
        if self.face.iter().any(|v| !self.is_defined(v)) {
            self.deferred.push(DeferredFace { vertices: self.face.clone(), material, object, line: self.lines.line_number });
            return Ok(());
        }
        self.triangulate_face(material, object, self.lines.line_number)
    }

    fn is_defined(&self, vertex: &FaceVertex) -> bool {
        (vertex.position as usize) < self.positions.len() && is_below(vertex.uv, self.uvs.len()) && is_below(vertex.normal, self.normals.len())
    }

    /// Drops references to texture coordinates and normals that the file does not define; the face keeps its geometry.
    fn drop_undefined(&mut self, line: u64) -> Result<()> {
        let (uvs, normals) = (self.uvs.len(), self.normals.len());
        if self.face.iter().any(|v| !is_below(v.uv, uvs)) {
            self.face.iter_mut().for_each(|v| v.uv = None);
            self.report.warn(Reason::TextureIndexOutOfRange, format!("line {line}"))?;
        }
        if self.face.iter().any(|v| !is_below(v.normal, normals)) {
            self.face.iter_mut().for_each(|v| v.normal = None);
            self.report.warn(Reason::NormalIndexOutOfRange, format!("line {line}"))?;
        }
        Ok(())
    }

    /// Returns the object that faces currently belong to; adds it with its first face.
    fn current_object(&mut self) -> u32 {
        let name = match self.of_format.split {
            Split::Group if !self.group.is_empty() => self.group.as_str(),
            _ => "",
        };
        if let Some(number) = self.object_numbers.get(name) {
            return *number;
        }
        let path = self.report.path();
        let unpacked = if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz")) { path.with_extension("") } else { path.to_path_buf() };
        let file_stem = || unpacked.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let display_name = if name.is_empty() { file_stem() } else { name.to_owned() };
        let number = self.objects.len() as u32;
        self.object_numbers.insert(name.to_owned(), number);
        self.objects.push(Object { name: display_name, class: "generic".into(), ..Object::default() });
        number
    }

    fn triangulate_face(&mut self, material: FaceMaterial, object: u32, line: u64) -> Result<()> {
        let location = || format!("line {line}");
        self.drop_repeated_vertices();
        let limit = self.options.max_ring_vertices;
        if self.face.len() as u64 > limit {
            return self.report.skip(Reason::FaceOverLimit.with("limit", limit), location);
        }
        if self.face.len() < 3 {
            return self.report.skip(Reason::FaceWithTooFewVertices, location);
        }
        if material.invisible {
            self.report.omit(Reason::FaceTransparent, 1);
            return Ok(());
        }
        self.ring.clear();
        self.ring.extend(self.face.iter().map(|v| self.positions[v.position as usize]));
        match self.triangulator.triangulate(&self.ring, &[self.ring.len()]) {
            Err(error) => return self.report.skip(error.reason(), location),
            Ok(Coverage::Inexact) => self.report.warn(Reason::FaceEdgesCross, location())?,
            Ok(Coverage::Exact) => {}
        }
        self.push_triangles(material, object)
    }

    fn push_triangles(&mut self, face_material: FaceMaterial, object: u32) -> Result<()> {
        let has_uvs = self.face.iter().all(|v| v.uv.is_some());
        let has_normals = self.face.iter().all(|v| v.normal.is_some());
        let textured = face_material.textured.filter(|_| has_uvs);
        let material = match textured {
            Some(material) => material,
            None if face_material.is_fallback && !self.colors.is_empty() => {
                let colors = self.face.iter().map(|v| self.colors.get(v.position as usize).copied().unwrap_or(DEFAULT_VERTEX_COLOR));
                self.materials.average_vertex_colors(colors)
            }
            None => face_material.untextured,
        };
        for t in self.triangulator.triangles().as_chunks::<3>().0 {
            let corners = t.map(|i| self.face[i as usize]);
            let uvs =
                textured.map(|_| shift_uvs(corners.map(|c| face_material.transform_uv(self.uvs[c.uv.unwrap_or(0) as usize])), face_material.wrap));
            let normals = has_normals.then(|| corners.map(|c| self.normals[c.normal.unwrap_or(0) as usize]));
            self.batch.push(&self.positions, FaceTriangle { vertices: corners.map(|c| c.position), material, object, uvs, normals });
        }
        self.triangles += self.triangulator.triangles().len() as u64 / 3;
        self.report.check_limit(LimitCheck::triangles(self.triangles, self.options.max_triangles))
    }

    /// Drops vertices that repeat the one before, and last ones that repeat the first.
    fn drop_repeated_vertices(&mut self) {
        self.face.dedup_by_key(|v| v.position);
        while self.face.len() > 1 && self.face.first().map(|v| v.position) == self.face.last().map(|v| v.position) {
            self.face.pop();
        }
    }

    /// Triangulates the deferred faces at the end of the file, when all vertices are defined.
    fn triangulate_deferred(&mut self) -> Result<()> {
        for face in std::mem::take(&mut self.deferred) {
            if !face.vertices.iter().all(|v| (v.position as usize) < self.positions.len()) {
                self.report.skip(Reason::IndexOutOfRange, || format!("line {}", face.line))?;
                continue;
            }
            self.face = face.vertices;
            self.drop_undefined(face.line)?;
            self.triangulate_face(face.material, face.object, face.line)?;
        }
        Ok(())
    }
}

fn is_below(index: Option<u32>, count: usize) -> bool {
    index.is_none_or(|n| (n as usize) < count)
}

fn convert_to_z_up([x, y, z]: Vec3, up: Up) -> Vec3 {
    match up {
        Up::Z => [x, y, z],
        Up::Y => [x, -z, y],
    }
}

impl DocumentReader for ObjReader {
    fn next_batch(&mut self) -> Result<Option<Batch>> {
        while !self.at_end && self.batch.triangle_count() < BATCH_TRIANGLES {
            if !self.read_line()? {
                self.at_end = true;
                self.triangulate_deferred()?;
                report_invisible(self.report.count(Reason::FaceTransparent), self.materials.library.has_inverted, &mut self.report);
            }
        }
        Ok((self.batch.triangle_count() > 0).then(|| self.batch.take()))
    }

    fn srs_name(&self) -> Option<&str> {
        None
    }

    fn materials(&self) -> &[Material] {
        self.materials.table.materials()
    }

    fn objects(&self) -> &[Object] {
        &self.objects
    }

    fn instances(&self) -> &[Instance] {
        &self.instances
    }

    fn instances_mut(&mut self) -> &mut Vec<Instance> {
        &mut self.instances
    }

    fn textures(&self) -> &[DocumentImage] {
        self.materials.images.files()
    }

    fn report(&self) -> &AssetReport {
        self.report.report()
    }
}
