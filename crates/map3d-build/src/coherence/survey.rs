//! Surveys the objects of an asset, and stores the result beside its mesh so that later checks need not read the mesh again.

use std::collections::HashMap;
use std::io::{BufRead, BufReader};
use std::path::Path;

use bytemuck::{Pod, Zeroable};
use map3d_base::asset::{AssetMesh, Instance, Materials};
use map3d_base::file::{self, HEADER_BYTES, aligned, header_start};
use map3d_base::{Box3, Error, Result, Vec3};
use serde::Deserialize;
use twox_hash::XxHash3_64;

pub const SURVEY_FILE: &str = "objects.m3o";
const MAGIC: &[u8; 4] = b"M3DO";
const VERSION: u32 = 1;
const NO_PARENT: u32 = u32::MAX;
const TEXTURED: u32 = 1;
const INSTANCES: u32 = 2;
/// Triangles between two releases of resident pages.
const PIECE: usize = 1 << 20;
/// Coordinates that differ by less are equal.
const STEPS_PER_M: f64 = 1000.0;

/// An object without its children, as imported.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SurveyedObject {
    /// World coordinates, low and high corner; placed prototypes included. Empty (low > high) without geometry.
    pub bounds: [f64; 6],
    /// Hash of the name, 0 without one.
    pub name: u64,
    /// Hash of the geometry to the millimetre, which does not depend on the order of triangles; 0 without geometry.
    pub content: u64,
    pub triangles: u32,
    /// Index of the parent; `u32::MAX` at the top.
    pub parent: u32,
    /// Indices of class and level of detail in the lists of the survey.
    pub class: u16,
    pub lod: u16,
    /// Bit 0: some triangle is textured; bit 1: it has placed prototypes.
    pub flags: u32,
}

const _: () = assert!(size_of::<SurveyedObject>() == 80);

/// `lods[0]` is empty, for objects without a level of detail.
#[derive(Clone, Debug, PartialEq)]
pub struct Survey {
    pub classes: Vec<String>,
    pub lods: Vec<String>,
    pub objects: Vec<SurveyedObject>,
}

/// Returns the survey of an asset's folder; makes it unless the folder has that of its mesh.
pub fn read_or_survey(folder: &Path) -> Result<Survey> {
    let path = folder.join(SURVEY_FILE);
    let mesh = mesh_checksum(folder)?;
    if let Some(known) = read(&path, mesh) {
        return Ok(known);
    }
    let survey = survey_asset(folder)?;
    write(&path, mesh, &survey)?;
    Ok(survey)
}

fn survey_asset(folder: &Path) -> Result<Survey> {
    let mut survey = read_objects(&folder.join("objects.jsonl"))?;
    let path = folder.join("materials.json");
    let text = std::fs::read_to_string(&path).map_err(|e| Error::storage(&path, e))?;
    let Materials { materials, instances } = serde_json::from_str(&text).map_err(|e| Error::format(&path, e.to_string()))?;
    let textured: Vec<bool> = materials.iter().map(|m| m.texture.is_some()).collect();
    let mesh = AssetMesh::open(&folder.join("mesh.m3a"))?;
    let mut prototypes: HashMap<u32, (Box3, u64)> = HashMap::new();
    let (positions, objects, numbers, used) = (mesh.positions(), mesh.objects(), mesh.prototypes(), mesh.materials());
    let count = survey.objects.len();
    for (t, corners) in mesh.triangles().iter().enumerate() {
        if t % PIECE == PIECE - 1 {
            mesh.release();
        }
        let corners = corners.map(|v| positions[v as usize]);
        if numbers[t] > 0 {
            let (bounds, content) = prototypes.entry(numbers[t]).or_insert((Box3::EMPTY, 0));
            corners.iter().for_each(|p| bounds.add_point(*p));
            *content = content.wrapping_add(triangle_hash(corners));
            continue;
        }
        let Some(object) = survey.objects.get_mut(objects[t] as usize) else {
            return Err(Error::format(mesh.path(), format!("triangle {t} belongs to object {}, of {count}", objects[t])));
        };
        corners.iter().for_each(|p| object.add_point(*p));
        object.content = object.content.wrapping_add(triangle_hash(corners));
        object.triangles += 1;
        object.flags |= if textured.get(used[t] as usize) == Some(&true) { TEXTURED } else { 0 };
    }
    mesh.release();
    for instance in &instances {
        if let (Some(object), Some((bounds, content))) = (survey.objects.get_mut(instance.object as usize), prototypes.get(&instance.prototype)) {
            object.add_instance(instance, bounds, *content);
        }
    }
    Ok(survey)
}

impl SurveyedObject {
    fn add_point(&mut self, p: Vec3) {
        for k in 0..3 {
            self.bounds[k] = self.bounds[k].min(p[k]);
            self.bounds[3 + k] = self.bounds[3 + k].max(p[k]);
        }
    }

    /// Adds the eight moved corners of a prototype's box.
    fn add_instance(&mut self, instance: &Instance, bounds: &Box3, content: u64) {
        let m = &instance.transform;
        for corner in 0..8 {
            let p = [0, 1, 2].map(|k| if corner >> k & 1 == 0 { bounds.lo[k] } else { bounds.hi[k] });
            self.add_point([0, 1, 2].map(|k| m[4 * k] * p[0] + m[4 * k + 1] * p[1] + m[4 * k + 2] * p[2] + m[4 * k + 3]));
        }
        let place = m.map(|v| (v * STEPS_PER_M).round() as i64);
        self.content = self.content.wrapping_add(XxHash3_64::oneshot_with_seed(content, bytemuck::bytes_of(&place)));
        self.flags |= INSTANCES;
    }
}

fn triangle_hash(corners: [Vec3; 3]) -> u64 {
    // The conversion of huge numbers saturates.
    XxHash3_64::oneshot(bytemuck::bytes_of(&corners.map(|p| p.map(|v| (v * STEPS_PER_M).round() as i64))))
}

/// The members of a line of objects.jsonl that a survey needs.
#[derive(Deserialize)]
struct Line {
    name: String,
    class: String,
    parent: Option<u32>,
    lod: Option<String>,
}

fn read_objects(path: &Path) -> Result<Survey> {
    let file = std::fs::File::open(path).map_err(|e| Error::storage(path, e))?;
    let (mut classes, mut lods) = (Words::default(), Words::default());
    lods.number(String::new());
    let mut objects = Vec::new();
    for line in BufReader::new(file).lines() {
        let line = line.map_err(|e| Error::storage(path, e))?;
        let line: Line = serde_json::from_str(&line).map_err(|e| Error::format(path, e.to_string()))?;
        objects.push(SurveyedObject {
            bounds: [f64::INFINITY, f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY],
            name: if line.name.is_empty() { 0 } else { XxHash3_64::oneshot(line.name.as_bytes()) },
            parent: line.parent.unwrap_or(NO_PARENT),
            class: classes.number(line.class),
            lod: lods.number(line.lod.unwrap_or_default()),
            ..SurveyedObject::zeroed()
        });
    }
    Ok(Survey { classes: classes.list, lods: lods.list, objects })
}

/// Numbers words in the order of their first occurrence.
#[derive(Default)]
struct Words {
    list: Vec<String>,
    numbers: HashMap<String, u16>,
}

impl Words {
    /// Words after the 65,535th are one.
    fn number(&mut self, word: String) -> u16 {
        if let Some(number) = self.numbers.get(&word) {
            return *number;
        }
        let number = self.list.len().min(u16::MAX as usize) as u16;
        if self.list.len() <= number as usize {
            self.list.push(word.clone());
        }
        self.numbers.insert(word, number);
        number
    }
}

/// Returns the checksum in the header of the mesh.
fn mesh_checksum(folder: &Path) -> Result<u64> {
    let path = folder.join("mesh.m3a");
    let mut head = [0; 16];
    let mut file = std::fs::File::open(&path).map_err(|e| Error::storage(&path, e))?;
    std::io::Read::read_exact(&mut file, &mut head).map_err(|_| Error::format(&path, "truncated"))?;
    Ok(u64::from_le_bytes(head[8..].try_into().expect("8 bytes")))
}

fn read(path: &Path, mesh: u64) -> Option<Survey> {
    let bytes = std::fs::read(path).ok()?;
    file::check_header(path, &bytes, MAGIC, VERSION, true).ok()?;
    let word = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().expect("8 bytes"));
    let (text, count) = (usize::try_from(word(24)).ok()?, usize::try_from(word(32)).ok()?);
    let (classes, lods) = serde_json::from_slice(bytes.get(HEADER_BYTES..HEADER_BYTES.checked_add(text)?)?).ok()?;
    let at = HEADER_BYTES + aligned(text);
    let records = bytes.get(at..at.checked_add(count.checked_mul(size_of::<SurveyedObject>())?)?)?;
    let objects = records.chunks_exact(size_of::<SurveyedObject>()).map(bytemuck::pod_read_unaligned).collect();
    (word(16) == mesh).then_some(Survey { classes, lods, objects })
}

/// Writes the survey without syncing it to the disk: a lost or torn one is made again.
fn write(path: &Path, mesh: u64, survey: &Survey) -> Result<()> {
    let text = serde_json::to_vec(&(&survey.classes, &survey.lods)).expect("words are plain data");
    let mut bytes = vec![0; HEADER_BYTES];
    for section in [&text[..], bytemuck::cast_slice(&survey.objects)] {
        bytes.extend_from_slice(section);
        bytes.resize(aligned(bytes.len()), 0);
    }
    let words = [mesh, text.len() as u64, survey.objects.len() as u64].map(u64::to_le_bytes);
    bytes[16..40].copy_from_slice(words.as_flattened());
    let start = header_start(MAGIC, VERSION, file::checksum(&bytes[HEADER_BYTES..]));
    bytes[..16].copy_from_slice(&start);
    let part = path.with_extension("part");
    std::fs::write(&part, &bytes).and_then(|()| std::fs::rename(&part, path)).map_err(|e| Error::storage(path, e))
}
