//! The assets of a scene, opened when they are needed, with meshes as mapped files; and their summaries from earlier builds.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use map3d_base::asset::{AssetMesh, Instance, Material, Materials};
use map3d_base::{Error, KeptSpace, Result};
use twox_hash::XxHash3_128;

use crate::BuildRequest;
use crate::asset_summary::{AssetSummary, EXTENSION};
use crate::content::adjusted_heads;
use crate::files::prune;

/// Incremented when the same assets would yield other summaries or chunks.
pub(crate) const BUILD_FORMAT: u32 = 2;
const FOLDER: &str = "build";
const OBJECTS: &str = "objects.jsonl";
/// In the JSON of a material to which the source gives no colour.
const SURFACE: &[u8] = b"\"surface\"";

/// The assets of a request, by number.
pub(crate) struct Assets {
    entries: Vec<AssetEntry>,
    summaries_folder: PathBuf,
    /// Summaries of assets before they changed or were removed.
    previous: Vec<AssetSummary>,
}

struct AssetEntry {
    folder: PathBuf,
    digest: String,
    opened: Option<Asset>,
    summary: Option<AssetSummary>,
    /// This build computed the summary.
    is_new: bool,
}

impl Assets {
    /// Reads the digests of all assets without opening them; an asset whose summary is valid need not be opened.
    pub fn load(folder: &Path, request: &BuildRequest, extent: Option<&KeptSpace>) -> Result<Self> {
        let summaries_folder = folder.join(FOLDER);
        let mut out = Self { entries: Vec::new(), summaries_folder, previous: Vec::new() };
        for name in &request.assets {
            let place = folder.join("assets").join(name);
            let digest = compute_digest(&place, request, extent)?;
            let summary = AssetSummary::read(&out.summary_path(name));
            let is_valid =
                summary.as_ref().is_some_and(|s| s.details.digest == digest && s.details.prototypes.iter().all(|p| folder.join(p).exists()));
            let (summary, previous) = if is_valid { (summary, None) } else { (None, summary) };
            out.previous.extend(previous);
            out.entries.push(AssetEntry { folder: place, digest, opened: None, summary, is_new: false });
        }
        out.previous.extend(out.read_removed(&request.assets)?);
        Ok(out)
    }

    /// Reads the summaries of assets that the request does not name.
    fn read_removed(&self, names: &[String]) -> Result<Vec<AssetSummary>> {
        let Ok(entries) = std::fs::read_dir(&self.summaries_folder) else { return Ok(Vec::new()) };
        let names: BTreeSet<PathBuf> = names.iter().map(|n| self.summary_path(n)).collect();
        let paths: Vec<PathBuf> =
            entries.map(|e| e.map(|e| e.path()).map_err(|e| Error::storage(&self.summaries_folder, e))).collect::<Result<_>>()?;
        Ok(paths.iter().filter(|p| !names.contains(*p)).filter_map(|p| AssetSummary::read(p)).collect())
    }

    fn summary_path(&self, name: &str) -> PathBuf {
        self.summaries_folder.join(format!("{name}.{EXTENSION}"))
    }

    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Opens an asset unless it is open.
    pub fn open(&mut self, k: usize) -> Result<&Asset> {
        if self.entries[k].opened.is_none() {
            self.entries[k].opened = Some(Asset::open(self.entries[k].folder.clone())?);
        }
        Ok(self.get(k))
    }

    /// Returns an asset that is open.
    pub fn get(&self, k: usize) -> &Asset {
        self.entries[k].opened.as_ref().expect("opened before")
    }

    pub fn close_all(&mut self) {
        self.entries.iter_mut().for_each(|e| e.opened = None);
    }

    pub fn summary(&self, k: usize) -> Option<&AssetSummary> {
        self.entries[k].summary.as_ref()
    }

    /// Returns the summaries in the order of the assets, skipping assets without one.
    pub fn summaries(&self) -> impl Iterator<Item = &AssetSummary> {
        self.entries.iter().filter_map(|e| e.summary.as_ref())
    }

    pub fn previous(&self) -> impl Iterator<Item = &AssetSummary> {
        self.previous.iter()
    }

    pub fn is_new(&self, k: usize) -> bool {
        self.entries[k].is_new
    }

    /// Returns the summaries of the last build: those still valid, and previous ones.
    pub fn of_last_build(&self) -> impl Iterator<Item = &AssetSummary> {
        self.entries.iter().filter(|e| !e.is_new).filter_map(|e| e.summary.as_ref()).chain(&self.previous)
    }

    pub fn without_summary(&self) -> Vec<usize> {
        (0..self.len()).filter(|k| self.summary(*k).is_none()).collect()
    }

    /// Moves outdated summaries to the previous ones.
    pub fn invalidate(&mut self, is_outdated: impl Fn(&AssetSummary) -> bool) {
        let outdated = self.entries.iter_mut().filter(|e| e.summary.as_ref().is_some_and(&is_outdated));
        self.previous.extend(outdated.filter_map(|e| e.summary.take()));
    }

    /// Stores a summary for this build and, on disk, for the next one.
    pub fn store(&mut self, k: usize, mut summary: AssetSummary) -> Result<()> {
        let entry = &mut self.entries[k];
        summary.details.digest.clone_from(&entry.digest);
        let name = entry.folder.file_name().and_then(|n| n.to_str()).unwrap_or_default();
        summary.write(&self.summaries_folder.join(format!("{name}.{EXTENSION}")))?;
        (entry.summary, entry.is_new) = (Some(summary), true);
        Ok(())
    }

    /// Removes the summaries of assets that the scene no longer has.
    pub fn prune(&self) -> Result<()> {
        let names: BTreeSet<&str> = self.entries.iter().filter_map(|e| e.folder.file_name()?.to_str()).collect();
        prune(&self.summaries_folder, |file| file.strip_suffix(EXTENSION).and_then(|f| f.strip_suffix('.')).is_some_and(|name| names.contains(name)))
    }
}

/// Hashes everything that a summary depends on except the keys of textures. The checksum in its header represents the mesh.
fn compute_digest(folder: &Path, request: &BuildRequest, extent: Option<&KeptSpace>) -> Result<String> {
    let mut hash = XxHash3_128::with_seed(u64::from(BUILD_FORMAT));
    let mut write = |bytes: &[u8]| {
        hash.write(&(bytes.len() as u64).to_le_bytes());
        hash.write(bytes);
    };
    write(env!("CARGO_PKG_VERSION").as_bytes());
    write(bytemuck::bytes_of(&request.origin));
    write(&serde_json::to_vec(&request.options).expect("options are plain data"));
    if let Some(extent) = extent {
        write(&serde_json::to_vec(extent).expect("an extent is plain data"));
    }
    let mesh = folder.join("mesh.m3a");
    let io = |path: &Path| {
        let path = path.to_path_buf();
        move |e| Error::storage(&path, e)
    };
    let mut head = [0; 64];
    let mut file = std::fs::File::open(&mesh).map_err(io(&mesh))?;
    write(&file.metadata().map_err(io(&mesh))?.len().to_le_bytes());
    std::io::Read::read_exact(&mut file, &mut head).map_err(|_| Error::format(&mesh, "truncated"))?;
    write(&head);
    adjusted_heads(folder)?.iter().for_each(|head| write(head));
    let mut uncolored = false;
    for name in ["materials.json", "ids.u32", OBJECTS] {
        let path = folder.join(name);
        // Only colours that the source does not give depend on objects.
        if name == OBJECTS && !uncolored {
            continue;
        }
        let bytes = std::fs::read(&path).map_err(io(&path))?;
        uncolored |= name == "materials.json" && bytes.windows(SURFACE.len()).any(|w| w == SURFACE);
        write(&bytes);
    }
    Ok(format!("{:032x}", hash.finish_128()))
}

pub(crate) struct Asset {
    pub folder: PathBuf,
    pub mesh: AssetMesh,
    pub materials: Vec<Material>,
    pub instances: Vec<Instance>,
    /// The registry's id of each object.
    pub ids: Vec<u32>,
}

impl Asset {
    pub fn open(folder: PathBuf) -> Result<Self> {
        let mesh = AssetMesh::open(&folder.join("mesh.m3a"))?;
        let path = folder.join("materials.json");
        let text = std::fs::read_to_string(&path).map_err(|e| Error::storage(&path, e))?;
        let Materials { materials, instances } = serde_json::from_str(&text).map_err(|e| Error::format(&path, e.to_string()))?;
        let ids = read_ids(&folder.join("ids.u32"))?;
        let asset = Self { folder, mesh, materials, instances, ids };
        asset.validate()?;
        asset.mesh.release();
        Ok(asset)
    }

    pub fn objects_path(&self) -> PathBuf {
        self.folder.join(OBJECTS)
    }

    fn validate(&self) -> Result<()> {
        let fail = |what: String| Err(Error::format(self.folder.join("mesh.m3a"), what));
        if let Some(m) = self.mesh.drawn().flat_map(AssetMesh::materials).find(|m| **m as usize >= self.materials.len()) {
            return fail(format!("material {m} of {}", self.materials.len()));
        }
        if let Some(o) = self.mesh.drawn().flat_map(AssetMesh::objects).find(|o| **o as usize >= self.ids.len()) {
            return fail(format!("object {o}, but ids.u32 holds {} ids", self.ids.len()));
        }
        if let Some(count) = self.mesh.adjustments().map(|a| a.shifts.len()).filter(|n| *n != self.ids.len()) {
            return fail(format!("adjustments of {count} objects, but ids.u32 holds {} ids", self.ids.len()));
        }
        let sound = |i: &Instance| i.prototype > 0 && (i.object as usize) < self.ids.len() && i.transform.iter().all(|v| v.is_finite());
        match self.instances.iter().position(|i| !sound(i)) {
            Some(k) => Err(Error::format(self.folder.join("materials.json"), format!("instance {k}: prototype, object or transform out of range"))),
            None => Ok(()),
        }
    }
}

fn read_ids(path: &Path) -> Result<Vec<u32>> {
    let bytes = std::fs::read(path).map_err(|e| Error::storage(path, e))?;
    if bytes.len() % 4 != 0 {
        return Err(Error::format(path, format!("{} bytes, expected four for each id", bytes.len())));
    }
    let ids: Vec<u32> = bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    match ids.iter().position(|id| *id == 0) {
        Some(k) => Err(Error::format(path, format!("object {k} has id 0, expected a positive id"))),
        None => Ok(ids),
    }
}
