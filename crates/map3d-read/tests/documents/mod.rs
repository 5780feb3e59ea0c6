//! Writes documents to temporary folders and reads them completely.

pub mod city_model;
pub mod random;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use map3d_base::asset::{AssetReport, Batch, Instance, Material, Object, Rank};
use map3d_base::reason::Message;
use map3d_base::vec3::{length, triangle_normal};
use map3d_base::{Error, Result, Vec3};
use map3d_read::{DocumentImage, FileHead, ReadOptions, SourceFormat, detect, open};
use serde_json::Value;

/// A temporary folder, removed when dropped.
pub struct Folder(pub PathBuf);

impl Folder {
    pub fn new(name: &str) -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("map3d-read-{name}-{}-{number}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        fs::create_dir_all(&path).expect("create a folder");
        Self(path.canonicalize().expect("canonical path"))
    }

    pub fn put(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.join(name);
        fs::create_dir_all(path.parent().expect("a parent")).expect("create a folder");
        fs::write(&path, bytes).expect("write a file");
        path
    }

    /// Writes a PNG of one colour (red, green, blue, alpha).
    pub fn put_png(&self, name: &str, width: u32, height: u32, texel: [u8; 4]) -> PathBuf {
        self.put(name, encode_png(width, height, texel))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Encodes a PNG of one colour.
pub fn encode_png(width: u32, height: u32, texel: [u8; 4]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgba);
    let mut writer = encoder.write_header().expect("header");
    writer.write_image_data(&texel.repeat((width * height) as usize)).expect("image");
    writer.finish().expect("finish");
    bytes
}

/// The complete contents of a document.
#[derive(Debug)]
pub struct ParsedDocument {
    pub batches: Vec<Batch>,
    pub objects: Vec<Object>,
    pub materials: Vec<Material>,
    pub instances: Vec<Instance>,
    pub textures: Vec<DocumentImage>,
    pub srs_name: Option<String>,
    pub crs_names: Vec<Option<String>>,
    pub instance_crs: Vec<u16>,
    pub report: AssetReport,
}

/// Returns options that only one format has.
pub fn of_format(options: Value) -> ReadOptions {
    ReadOptions::from_json(&options.to_string()).expect("valid options")
}

/// Returns the format in which a file is.
pub fn detect_file(path: &Path) -> Option<&'static SourceFormat> {
    FileHead::read(path).ok().and_then(|head| detect(&head))
}

/// One triangle and its attributes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    pub corners: [Vec3; 3],
    pub uvs: Option<[[f32; 2]; 3]>,
    pub material: u32,
    pub object: u32,
    pub rank: Rank,
    pub prototype: u32,
}

pub fn read_with(path: &Path, format: &SourceFormat, options: &ReadOptions) -> Result<ParsedDocument> {
    let mut reader = open(path, format, options)?;
    let mut batches = Vec::new();
    while let Some(batch) = reader.next_batch()? {
        check_batch(&batch);
        batches.push(batch);
    }
    assert!(reader.next_batch()?.is_none(), "no batch after the end");
    let document = ParsedDocument {
        batches,
        objects: reader.objects().to_vec(),
        materials: reader.materials().to_vec(),
        instances: reader.instances().to_vec(),
        textures: reader.textures().to_vec(),
        srs_name: reader.srs_name().map(str::to_owned),
        crs_names: reader.crs_names().into_iter().map(|name| name.map(str::to_owned)).collect(),
        instance_crs: reader.instance_crs().to_vec(),
        report: reader.report().clone(),
    };
    document.check_indices();
    Ok(document)
}

fn check_batch(batch: &Batch) {
    let n = batch.triangles.len();
    assert!(n > 0, "batches are not empty");
    assert_eq!([batch.materials.len(), batch.objects.len(), batch.ranks.len()], [n; 3]);
    assert!(batch.uvs.is_empty() || batch.uvs.len() == n);
    assert!(batch.normals.is_empty() || batch.normals.len() == n);
    assert!(batch.triangles.as_flattened().iter().all(|v| (*v as usize) < batch.positions.len()));
}

impl ParsedDocument {
    fn check_indices(&self) {
        for batch in &self.batches {
            assert!(batch.materials.iter().all(|m| (*m as usize) < self.materials.len()), "materials exist");
            assert!(batch.objects.iter().all(|o| (*o as usize) < self.objects.len()), "objects exist");
            assert!((batch.crs as usize) < self.crs_names.len(), "coordinate systems exist");
        }
        let prototypes: Vec<u32> = self.batches.iter().map(|b| b.prototype).collect();
        for instance in &self.instances {
            assert!(instance.prototype > 0 && prototypes.contains(&instance.prototype), "prototypes exist");
            assert!((instance.object as usize) < self.objects.len());
        }
        for material in &self.materials {
            assert!(material.texture.as_ref().is_none_or(|key| self.textures.iter().any(|t| t.key == *key)), "textures exist");
        }
        for object in &self.objects {
            assert!(object.parent.is_none_or(|p| (p as usize) < self.objects.len()));
        }
    }

    pub fn triangles(&self) -> Vec<Triangle> {
        let batch_triangles = |b: &Batch| -> Vec<Triangle> {
            let triangle = |(i, t): (usize, &[u32; 3])| Triangle {
                corners: t.map(|v| b.positions[v as usize]),
                uvs: b.uvs.get(i).copied(),
                material: b.materials[i],
                object: b.objects[i],
                rank: b.ranks[i],
                prototype: b.prototype,
            };
            b.triangles.iter().enumerate().map(triangle).collect()
        };
        self.batches.iter().flat_map(batch_triangles).collect()
    }

    pub fn count(&self) -> usize {
        self.batches.iter().map(|b| b.triangles.len()).sum()
    }

    pub fn area(&self) -> f64 {
        self.triangles().iter().map(|t| compute_area(t.corners)).sum()
    }

    /// Returns how often reasons whose code begins so were reported.
    pub fn reported(&self, code: &str) -> u64 {
        self.report.findings.iter().filter(|f| f.message.reason.code().starts_with(code)).map(|f| f.count).sum()
    }

    pub fn material_of(&self, triangle: usize) -> &Material {
        &self.materials[self.triangles()[triangle].material as usize]
    }
}

pub fn compute_area(corners: [Vec3; 3]) -> f64 {
    length(triangle_normal(corners)) / 2.0
}

pub fn is_format_error<T>(result: Result<T>, part: &str) -> bool {
    matches!(result, Err(Error::Format { what, .. }) if what.contains(part))
}

/// Returns true if `strict` or a reader refused the file for this reason.
pub fn is_error_of<T>(result: Result<T>, reason: impl Into<Message>) -> bool {
    is_format_error(result, &reason.into().to_string())
}

pub fn is_limit_error<T>(result: Result<T>, name: &str) -> bool {
    matches!(result, Err(Error::Limit { limit, .. }) if limit == name)
}
