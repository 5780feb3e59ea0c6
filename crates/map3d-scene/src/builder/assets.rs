//! The assets of a scene: opened when they are needed, meshes stay mapped files; and what earlier builds remember of them.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use map3d_base::asset::{AssetMesh, Instance, Material, Materials};
use map3d_base::{Error, Result};
use twox_hash::XxHash3_128;

use super::BuildRequest;
use super::files::prune;
use super::survey::{EXTENSION, Survey};

/// Raised when surveys or chunks would come out differently from the same assets.
pub(super) const BUILD_FORMAT: u32 = 2;
const FOLDER: &str = "build";

/// The assets of a request, by number.
pub(super) struct Assets {
    entries: Vec<Entry>,
    surveys_at: PathBuf,
    /// Surveys that assets had before they changed or went.
    former: Vec<Survey>,
}

struct Entry {
    folder: PathBuf,
    mark: String,
    opened: Option<Asset>,
    survey: Option<Survey>,
    /// The survey was made by this build.
    is_new: bool,
}

impl Assets {
    /// Looks at all assets without opening them; those whose survey still holds need not be opened.
    pub fn load(folder: &Path, request: &BuildRequest) -> Result<Self> {
        let surveys_at = folder.join(FOLDER);
        let mut out = Self { entries: Vec::new(), surveys_at, former: Vec::new() };
        for name in &request.assets {
            let place = folder.join("assets").join(name);
            let mark = mark_of(&place, request)?;
            let survey = Survey::read(&out.path_of(name));
            let holds = survey.as_ref().is_some_and(|s| s.facts.mark == mark && s.facts.prototypes.iter().all(|p| folder.join(p).exists()));
            let (survey, former) = if holds { (survey, None) } else { (None, survey) };
            out.former.extend(former);
            out.entries.push(Entry { folder: place, mark, opened: None, survey, is_new: false });
        }
        out.former.extend(out.gone(&request.assets)?);
        Ok(out)
    }

    /// Surveys of assets that the request does not name.
    fn gone(&self, names: &[String]) -> Result<Vec<Survey>> {
        let Ok(entries) = std::fs::read_dir(&self.surveys_at) else { return Ok(Vec::new()) };
        let names: BTreeSet<PathBuf> = names.iter().map(|n| self.path_of(n)).collect();
        let paths: Vec<PathBuf> = entries.map(|e| e.map(|e| e.path()).map_err(|e| Error::storage(&self.surveys_at, e))).collect::<Result<_>>()?;
        Ok(paths.iter().filter(|p| !names.contains(*p)).filter_map(|p| Survey::read(p)).collect())
    }

    fn path_of(&self, name: &str) -> PathBuf {
        self.surveys_at.join(format!("{name}.{EXTENSION}"))
    }

    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Opens an asset, if it is not yet.
    pub fn open(&mut self, k: usize) -> Result<&Asset> {
        if self.entries[k].opened.is_none() {
            self.entries[k].opened = Some(Asset::open(self.entries[k].folder.clone())?);
        }
        Ok(self.get(k))
    }

    /// One that was opened.
    pub fn get(&self, k: usize) -> &Asset {
        self.entries[k].opened.as_ref().expect("opened before")
    }

    pub fn close_all(&mut self) {
        self.entries.iter_mut().for_each(|e| e.opened = None);
    }

    pub fn survey(&self, k: usize) -> Option<&Survey> {
        self.entries[k].survey.as_ref()
    }

    /// In the order of the assets, of those that have one.
    pub fn surveys(&self) -> impl Iterator<Item = &Survey> {
        self.entries.iter().filter_map(|e| e.survey.as_ref())
    }

    pub fn former(&self) -> impl Iterator<Item = &Survey> {
        self.former.iter()
    }

    pub fn is_new(&self, k: usize) -> bool {
        self.entries[k].is_new
    }

    /// What the assets were before: surveys that still hold, and former ones.
    pub fn before(&self) -> impl Iterator<Item = &Survey> {
        self.entries.iter().filter(|e| !e.is_new).filter_map(|e| e.survey.as_ref()).chain(&self.former)
    }

    pub fn without_survey(&self) -> Vec<usize> {
        (0..self.len()).filter(|k| self.survey(*k).is_none()).collect()
    }

    /// Makes the surveys that no longer hold former ones.
    pub fn drop_surveys(&mut self, is_outdated: impl Fn(&Survey) -> bool) {
        let outdated = self.entries.iter_mut().filter(|e| e.survey.as_ref().is_some_and(&is_outdated));
        self.former.extend(outdated.filter_map(|e| e.survey.take()));
    }

    /// Keeps a survey for this build and, on disk, for the next.
    pub fn keep(&mut self, k: usize, mut survey: Survey) -> Result<()> {
        let entry = &mut self.entries[k];
        survey.facts.mark.clone_from(&entry.mark);
        let name = entry.folder.file_name().and_then(|n| n.to_str()).unwrap_or_default();
        survey.write(&self.surveys_at.join(format!("{name}.{EXTENSION}")))?;
        (entry.survey, entry.is_new) = (Some(survey), true);
        Ok(())
    }

    /// Removes surveys of assets that are gone, once nothing of them is left.
    pub fn prune(&self) -> Result<()> {
        let names: BTreeSet<&str> = self.entries.iter().filter_map(|e| e.folder.file_name()?.to_str()).collect();
        prune(&self.surveys_at, |file| file.strip_suffix(EXTENSION).and_then(|f| f.strip_suffix('.')).is_some_and(|name| names.contains(name)))
    }
}

/// Hash over all that a survey depends on but the keys of textures: the mesh by the checksum in its head.
fn mark_of(folder: &Path, request: &BuildRequest) -> Result<String> {
    let mut hash = XxHash3_128::with_seed(u64::from(BUILD_FORMAT));
    let mut write = |bytes: &[u8]| {
        hash.write(&(bytes.len() as u64).to_le_bytes());
        hash.write(bytes);
    };
    write(env!("CARGO_PKG_VERSION").as_bytes());
    write(bytemuck::bytes_of(&request.origin));
    write(&serde_json::to_vec(&request.options).expect("options are plain data"));
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
    for name in ["materials.json", "ids.u32"] {
        let path = folder.join(name);
        write(&std::fs::read(&path).map_err(io(&path))?);
    }
    Ok(format!("{:032x}", hash.finish_128()))
}

pub(super) struct Asset {
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

    fn validate(&self) -> Result<()> {
        let fail = |what: String| Err(Error::format(self.folder.join("mesh.m3a"), what));
        if let Some(m) = self.mesh.materials().iter().find(|m| **m as usize >= self.materials.len()) {
            return fail(format!("material {m} of {}", self.materials.len()));
        }
        if let Some(o) = self.mesh.objects().iter().find(|o| **o as usize >= self.ids.len()) {
            return fail(format!("object {o}, but ids.u32 holds {} ids", self.ids.len()));
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
        Some(k) => Err(Error::format(path, format!("object {k} has the id 0, which means nothing"))),
        None => Ok(ids),
    }
}
