//! The assets of a scene, opened: meshes stay mapped files.

use std::path::{Path, PathBuf};

use map3d_base::asset::{AssetMesh, Instance, Material, Materials};
use map3d_base::{Error, Result};

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
