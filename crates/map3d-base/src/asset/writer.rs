//! Writes an asset folder batch by batch, in bounded memory: each section grows in a file of its own, and `finish` joins them.

use std::collections::{BTreeMap, HashMap};
use std::fs::{self, File};
use std::hash::Hasher;
use std::io::{BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use bytemuck::NoUninit;
use sha2::{Digest, Sha256};
use twox_hash::XxHash3_64;

use super::mapped::{FLAG_NORMALS, MESH_MAGIC, MESH_VERSION, SECTIONS};
use super::validation::{GeometryLimits, SkippedGeometry, valid_triangles};
use super::{AssetReport, Batch, Materials, Object};
use crate::Reason;
use crate::error::{Error, Result};
use crate::file::{HEADER_BYTES, aligned, header_start};
use crate::vec3::Box3;

/// One growing section.
struct SectionFile {
    path: PathBuf,
    file: BufWriter<File>,
    bytes: u64,
}

impl SectionFile {
    fn create(path: PathBuf) -> Result<Self> {
        let file = File::options().create(true).truncate(true).read(true).write(true).open(&path).map_err(|e| Error::storage(&path, e))?;
        Ok(Self { path, file: BufWriter::new(file), bytes: 0 })
    }

    fn put<T: NoUninit>(&mut self, records: &[T]) -> Result<()> {
        let bytes: &[u8] = bytemuck::cast_slice(records);
        self.bytes += bytes.len() as u64;
        self.file.write_all(bytes).map_err(|e| Error::storage(&self.path, e))
    }
}

/// Writes `mesh.m3a`, `materials.json`, `objects.jsonl`, `textures/` and `report.json`. Nothing is complete before `finish`.
pub struct AssetWriter {
    folder: PathBuf,
    parts: Vec<SectionFile>,
    vertices: u64,
    triangles: u64,
    any_normals: bool,
    skipped: SkippedGeometry,
    bounds: Box3,
    limits: GeometryLimits,
    textures: HashMap<String, String>,
    /// Names of images in the document, by key.
    image_names: BTreeMap<String, String>,
}

impl AssetWriter {
    /// Creates the folder if it does not exist.
    pub fn create(folder: &Path) -> Result<Self> {
        fs::create_dir_all(folder.join("textures")).map_err(|e| Error::storage(folder, e))?;
        let parts = SECTIONS.iter().map(|name| SectionFile::create(folder.join(format!("{name}.part")))).collect::<Result<_>>()?;
        Ok(Self {
            folder: folder.to_path_buf(),
            parts,
            vertices: 0,
            triangles: 0,
            any_normals: false,
            skipped: SkippedGeometry::default(),
            bounds: Box3::EMPTY,
            limits: GeometryLimits::default(),
            textures: HashMap::new(),
            image_names: BTreeMap::new(),
        })
    }

    /// Appends the valid triangles of a batch; positions are world coordinates, those of a prototype in its own frame.
    pub fn append(&mut self, batch: &Batch) -> Result<()> {
        check_lengths(batch)?;
        let keep = valid_triangles(batch, self.limits, &mut self.skipped);
        let mut number = vec![u32::MAX; batch.positions.len()];
        let mut positions = Vec::new();
        let base = u32::try_from(self.vertices).map_err(|_| self.too_many())?;
        let (mut triangles, mut uvs, mut normals) = (Vec::new(), Vec::new(), Vec::new());
        let (mut materials, mut objects, mut ranks, mut prototypes) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (i, t) in batch.triangles.iter().enumerate().filter(|(i, _)| keep[*i]) {
            triangles.push(t.map(|v| {
                let slot = &mut number[v as usize];
                if *slot == u32::MAX {
                    *slot = base + positions.len() as u32;
                    positions.push(batch.positions[v as usize]);
                }
                *slot
            }));
            uvs.push(self.uv_of(batch, i));
            normals.push(batch.normals.get(i).copied().unwrap_or_default());
            materials.push(batch.materials[i]);
            objects.push(batch.objects[i]);
            ranks.push(batch.ranks[i] as u8);
            prototypes.push(batch.prototype);
        }
        if batch.prototype == 0 {
            positions.iter().for_each(|p| self.bounds.add_point(*p));
        }
        self.any_normals |= !batch.normals.is_empty();
        self.vertices += positions.len() as u64;
        self.triangles += triangles.len() as u64;
        if self.vertices >= u64::from(u32::MAX) {
            return Err(self.too_many());
        }
        self.parts[0].put(&positions)?;
        self.parts[1].put(&triangles)?;
        self.parts[2].put(&uvs)?;
        self.parts[3].put(&normals)?;
        self.parts[4].put(&materials)?;
        self.parts[5].put(&objects)?;
        self.parts[6].put(&ranks)?;
        self.parts[7].put(&prototypes)
    }

    /// Stores an image's original bytes once and returns its key. `extension` without dot, e.g. `jpg`.
    pub fn add_texture(&mut self, bytes: &[u8], extension: &str) -> Result<String> {
        let digest = Sha256::digest(bytes);
        let key: String = digest.iter().take(16).map(|b| format!("{b:02x}")).collect();
        if self.textures.insert(key.clone(), extension.to_owned()).is_none() {
            let path = self.folder.join("textures").join(format!("{key}.{extension}"));
            fs::write(&path, bytes).map_err(|e| Error::storage(&path, e))?;
        }
        Ok(key)
    }

    /// Notes the name that the document has for an image, for messages.
    pub fn name_image(&mut self, key: &str, name: &str) {
        self.image_names.entry(key.to_owned()).or_insert_with(|| name.to_owned());
    }

    /// Joins the sections and writes the tables; returns `report` with the counts of kept and skipped geometry.
    pub fn finish(mut self, materials: &Materials, objects: &[Object], mut report: AssetReport) -> Result<AssetReport> {
        self.join()?;
        self.write_json("materials.json", materials)?;
        let lines: Vec<String> = objects.iter().map(|o| serde_json::to_string(o).expect("objects are plain data")).collect();
        let text = if lines.is_empty() { String::new() } else { lines.join("\n") + "\n" };
        self.write("objects.jsonl", text.as_bytes())?;
        if !self.image_names.is_empty() {
            self.write_json("images.json", &self.image_names)?;
        }
        for (reason, count) in self.skipped.reasons() {
            report.add(reason, count, String::new);
        }
        let name = || self.skipped.stray_object.and_then(|k| objects.get(k as usize)).map_or_else(String::new, |o| o.name.clone());
        report.add(Reason::StrayVertex, self.skipped.stray, name);
        report.objects = objects.len() as u64;
        report.triangles = self.triangles;
        report.box_source = (!self.bounds.is_empty()).then_some([self.bounds.lo, self.bounds.hi]);
        self.write_json("report.json", &report)?;
        Ok(report)
    }

    fn uv_of(&mut self, batch: &Batch, i: usize) -> [[f32; 2]; 3] {
        let Some(uv) = batch.uvs.get(i) else { return [[0.0; 2]; 3] };
        if !uv.as_flattened().iter().all(|v| v.is_finite()) {
            self.skipped.bad_uv += 1;
            return [[0.0; 2]; 3];
        }
        if batch.uvs_shifted {
            return *uv;
        }
        let shift = [0, 1].map(|k| uv.iter().map(|c| c[k]).fold(f32::INFINITY, f32::min).floor());
        uv.map(|c| [c[0] - shift[0], c[1] - shift[1]])
    }

    fn too_many(&self) -> Error {
        Error::Limit {
            path: self.folder.clone(),
            what: "number of vertices",
            got: self.vertices,
            limit: "vertices per asset",
            value: u64::from(u32::MAX),
        }
    }

    /// Joins the sections in their order, each aligned, computes the checksum on the way, and renames the file to `mesh.m3a`.
    fn join(&mut self) -> Result<()> {
        let target = self.folder.join("mesh.m3a.part");
        let io = |e| Error::storage(&target, e);
        let mut out = BufWriter::new(File::create(&target).map_err(io)?);
        let mut hash = XxHash3_64::with_seed(0);
        out.write_all(&[0; HEADER_BYTES]).map_err(io)?;
        for (name, part) in SECTIONS.iter().zip(&mut self.parts) {
            if *name != "normals" || self.any_normals {
                copy_part(part, &mut out, &mut hash)?;
            }
        }
        let mut header = [0u8; HEADER_BYTES];
        header[..16].copy_from_slice(&header_start(MESH_MAGIC, MESH_VERSION, hash.finish()));
        header[16..24].copy_from_slice(&self.vertices.to_le_bytes());
        header[24..32].copy_from_slice(&self.triangles.to_le_bytes());
        header[32..36].copy_from_slice(&(u32::from(self.any_normals) * FLAG_NORMALS).to_le_bytes());
        out.seek(SeekFrom::Start(0)).map_err(io)?;
        out.write_all(&header).map_err(io)?;
        out.into_inner().map_err(|e| io(e.into_error()))?.sync_all().map_err(io)?;
        for part in self.parts.drain(..) {
            fs::remove_file(&part.path).map_err(|e| Error::storage(&part.path, e))?;
        }
        fs::rename(&target, self.folder.join("mesh.m3a")).map_err(io)
    }

    fn write_json(&self, name: &str, value: &impl serde::Serialize) -> Result<()> {
        self.write(name, (serde_json::to_string_pretty(value).expect("tables are plain data") + "\n").as_bytes())
    }

    fn write(&self, name: &str, bytes: &[u8]) -> Result<()> {
        let path = self.folder.join(name);
        fs::write(&path, bytes).map_err(|e| Error::storage(&path, e))
    }
}

fn copy_part(part: &mut SectionFile, out: &mut impl Write, hash: &mut XxHash3_64) -> Result<()> {
    let io = |e| Error::storage(&part.path, e);
    part.file.flush().map_err(io)?;
    let file = part.file.get_mut();
    file.seek(SeekFrom::Start(0)).map_err(io)?;
    let mut buffer = vec![0; 1 << 20];
    loop {
        let n = file.read(&mut buffer).map_err(io)?;
        if n == 0 {
            break;
        }
        hash.write(&buffer[..n]);
        out.write_all(&buffer[..n]).map_err(io)?;
    }
    let padding = vec![0; aligned(part.bytes as usize) - part.bytes as usize];
    hash.write(&padding);
    out.write_all(&padding).map_err(io)
}

fn check_lengths(batch: &Batch) -> Result<()> {
    let n = batch.triangles.len();
    let optional = |len: usize| len == 0 || len == n;
    let valid = batch.materials.len() == n
        && batch.objects.len() == n
        && batch.ranks.len() == n
        && optional(batch.uvs.len())
        && optional(batch.normals.len());
    if valid { Ok(()) } else { Err(Error::argument("batch: its per-triangle arrays differ in length")) }
}
