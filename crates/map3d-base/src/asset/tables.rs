//! Materials, objects and reports of an asset, as written to its JSON files.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::reason::{Message, Reason};

/// Class rank: decides between coplanar surfaces (spec/glossary.md).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Rank {
    Terrain = 0,
    Road = 1,
    Ground = 2,
    Other = 3,
    Installation = 4,
    Opening = 5,
}

impl Rank {
    /// Returns the rank of a number; `None` for an unknown one.
    pub fn from_number(number: u8) -> Option<Self> {
        [Self::Terrain, Self::Road, Self::Ground, Self::Other, Self::Installation, Self::Opening].into_iter().find(|rank| *rank as u8 == number)
    }
}

/// What a surface without a colour of its own is; a build chooses its colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[repr(u8)]
pub enum SurfaceClass {
    Wall = 0,
    Roof = 1,
    Ground = 2,
    Window = 3,
    Door = 4,
    Road = 5,
    Water = 6,
    Vegetation = 7,
    Terrain = 8,
    /// The source does not say.
    Other = 9,
}

impl SurfaceClass {
    pub const ALL: [Self; 10] =
        [Self::Wall, Self::Roof, Self::Ground, Self::Window, Self::Door, Self::Road, Self::Water, Self::Vegetation, Self::Terrain, Self::Other];

    /// Returns the name of the class in JSON files.
    pub fn name(self) -> &'static str {
        ["wall", "roof", "ground", "window", "door", "road", "water", "vegetation", "terrain", "other"][self as usize]
    }
}

/// How a texture continues outside [0, 1]; the numbers are the codes of chunk files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[repr(u8)]
pub enum Wrap {
    #[default]
    Wrap = 0,
    Mirror = 1,
    Clamp = 2,
    Border = 3,
    None = 4,
}

impl Wrap {
    /// Returns the mode of a code of a chunk file; `None` for an unknown one.
    pub fn from_code(code: u8) -> Option<Self> {
        [Self::Wrap, Self::Mirror, Self::Clamp, Self::Border, Self::None].into_iter().find(|wrap| *wrap as u8 == code)
    }
}

/// `texture` and `alpha` are keys: the first 32 hex digits of the SHA-256 of the image's bytes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Material {
    pub name: String,
    /// sRGB and opacity, 0..1.
    pub diffuse: [f32; 4],
    /// Set where the source gives neither colour nor texture: `diffuse` then means nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surface: Option<SurfaceClass>,
    pub texture: Option<String>,
    pub alpha: Option<String>,
    pub wrap: Wrap,
    /// sRGB and opacity, 0..1; used by `Wrap::Border`.
    pub border: [f32; 4],
    /// The texture or the alpha image has transparent texels.
    pub cutout: bool,
}

impl Default for Material {
    fn default() -> Self {
        Self {
            name: String::new(),
            diffuse: [0.8, 0.8, 0.8, 1.0],
            surface: None,
            texture: None,
            alpha: None,
            wrap: Wrap::Wrap,
            border: [0.0; 4],
            cutout: false,
        }
    }
}

/// A placement of a prototype: row-major 3 × 4, prototype → world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Instance {
    pub prototype: u32,
    pub object: u32,
    pub transform: [f64; 12],
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Materials {
    pub materials: Vec<Material>,
    #[serde(default)]
    pub instances: Vec<Instance>,
}

/// A city object of the source. `parent` is an index into the asset's objects.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Object {
    pub name: String,
    pub class: String,
    pub parent: Option<u32>,
    pub lod: Option<String>,
    pub attributes: BTreeMap<String, serde_json::Value>,
    /// All its surfaces have two-dimensional coordinates: their height 0 means nothing.
    #[serde(default, skip_serializing_if = "is_false")]
    pub without_height: bool,
}

fn is_false(value: &bool) -> bool {
    !value
}

/// How often something was reported. `example`: the first occurrence: a name, a line, a file; of reasons that name files, the first of them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    #[serde(flatten)]
    pub message: Message,
    pub count: u64,
    pub example: String,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct AssetReport {
    pub format: String,
    pub objects: u64,
    pub triangles: u64,
    pub findings: Vec<Finding>,
    /// The CRS as the source writes it.
    pub crs: Option<String>,
    /// Box of the kept geometry, in the coordinates of mesh.m3a.
    pub box_source: Option<[[f64; 3]; 2]>,
    /// The day that decided which versions of objects have ended; only where one of them has an end.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub versions_on: Option<String>,
}

/// Files that a finding names.
const MAX_NAMED_FILES: u64 = 5;

impl AssetReport {
    /// Adds `count` to what was reported; keeps the first example, or the first names of files.
    pub fn add(&mut self, message: impl Into<Message>, count: u64, example: impl FnOnce() -> String) {
        let message = message.into();
        match self.findings.iter_mut().find(|finding| finding.message == message) {
            Some(finding) => {
                finding.count += count;
                if message.reason.names_files() && finding.count <= MAX_NAMED_FILES {
                    finding.example = format!("{}, {}", finding.example, example());
                }
            }
            None if count > 0 => self.findings.push(Finding { message, count, example: example() }),
            None => {}
        }
    }

    /// Returns how often a reason was reported.
    pub fn count(&self, reason: Reason) -> u64 {
        self.findings.iter().filter(|finding| finding.message.reason == reason).map(|finding| finding.count).sum()
    }
}
