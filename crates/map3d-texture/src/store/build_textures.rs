//! Builds the textures of a scene: each image that a material names, with the mask of the texels that the scene uses, becomes one `.m3t` file.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use map3d_base::asset::{AssetMesh, Material};
use map3d_base::{Error, Reason, Result};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::store::file::{self, TextureFile, TextureKey, texture_key, texture_path};
use crate::store::source;
use crate::store::usage::mark_triangle;
use map3d_image::ImageLimits;
use map3d_image::PixelMask;
use map3d_image::decode::decode;

/// (stage, done, total) → false to stop.
pub type Progress<'a> = dyn Fn(&str, u64, u64) -> bool + Sync + 'a;

/// An asset whose textures are built. `folder` holds `textures/`.
pub struct TextureAsset<'a> {
    pub folder: &'a Path,
    pub mesh: &'a AssetMesh,
    pub materials: &'a [Material],
}

/// The images of a material, by their keys in the asset; at least one of them.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TextureSource {
    pub image: Option<String>,
    pub alpha: Option<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TextureInfo {
    pub key: TextureKey,
    pub width: u32,
    pub height: u32,
    pub has_alpha: bool,
}

/// Images of one kind of failure.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MissingImages {
    pub count: u64,
    pub example: String,
}

/// Why an image cannot be used: a code of spec/messages.json and the value that its text names.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TextureFault {
    pub code: String,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub values: BTreeMap<String, String>,
}

impl TextureFault {
    pub fn new(cause: &Error) -> Self {
        let (reason, values) = match cause {
            Error::Limit { value, .. } => (Reason::ImagePixelsOverLimit, BTreeMap::from([("limit".to_owned(), value.to_string())])),
            Error::Storage { source, .. } => (Reason::ImageUnreadable, BTreeMap::from([("error".to_owned(), source.kind().to_string())])),
            _ => (Reason::ImageDamaged, BTreeMap::new()),
        };
        Self { code: reason.code().to_owned(), values }
    }
}

/// The textures of a scene. A source without a sound image is absent and counted in `missing`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TextureKeys {
    pub by_source: BTreeMap<TextureSource, TextureInfo>,
    /// By reason.
    pub missing: BTreeMap<String, MissingImages>,
    /// Why images of `missing` cannot be used, by their keys in the assets.
    pub faults: BTreeMap<String, TextureFault>,
    /// Files that existed already.
    pub kept: u64,
    pub written: u64,
}

impl TextureKeys {
    pub fn get(&self, material: &Material) -> Option<&TextureInfo> {
        self.by_source.get(&texture_source(material)?)
    }
}

/// Returns the images that a material names, if any.
pub fn texture_source(material: &Material) -> Option<TextureSource> {
    let has_image = material.texture.is_some() || material.alpha.is_some();
    has_image.then(|| TextureSource { image: material.texture.clone(), alpha: material.alpha.clone() })
}

/// Builds the textures that the assets use into `out_dir` (`<aa>/<key>.m3t`); keeps files that exist. `threads` = 0: one per core.
/// Holds in memory one image per thread, and the runs of the masks of images that several assets share.
pub fn build_textures(assets: &[TextureAsset], out_dir: &Path, threads: usize, progress: &Progress) -> Result<TextureKeys> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|e| Error::argument(format!("threads: {e}")))?;
    let build = TextureBuild::new(assets, out_dir, progress);
    pool.install(|| {
        for (number, asset) in assets.iter().enumerate() {
            build.build_asset(number, asset)?;
            asset.mesh.release();
        }
        Ok(build.result.into_inner().expect("no thread panicked"))
    })
}

/// Removes texture files that no key names; returns their number.
pub fn prune_textures(out_dir: &Path, keys: &TextureKeys) -> Result<u64> {
    let wanted: BTreeSet<PathBuf> = keys.by_source.values().map(|info| texture_path(out_dir, &info.key)).collect();
    let list = |folder: &Path| -> Result<Vec<PathBuf>> {
        let entries = std::fs::read_dir(folder).map_err(|e| Error::storage(folder, e))?;
        entries.map(|entry| entry.map(|e| e.path()).map_err(|e| Error::storage(folder, e))).collect()
    };
    let mut removed = 0;
    if !out_dir.exists() {
        return Ok(0);
    }
    for folder in list(out_dir)?.into_iter().filter(|p| p.is_dir()) {
        for path in list(&folder)?.into_iter().filter(|p| !wanted.contains(p)) {
            std::fs::remove_file(&path).map_err(|e| Error::storage(&path, e))?;
            removed += 1;
        }
    }
    Ok(removed)
}

struct TextureBuild<'a> {
    out_dir: &'a Path,
    progress: &'a Progress<'a>,
    /// The last asset that uses each source: its texture is written then.
    last_use: HashMap<TextureSource, usize>,
    /// Runs of the masks of sources that a later asset also uses.
    pending: Mutex<HashMap<TextureSource, Vec<u8>>>,
    result: Mutex<TextureKeys>,
    done: AtomicU64,
    masks: AtomicU64,
    stopped: AtomicBool,
}

/// Masks after which the resident pages of an asset's mesh are dropped.
const MASKS_PER_RELEASE: u64 = 64;

impl<'a> TextureBuild<'a> {
    fn new(assets: &[TextureAsset], out_dir: &'a Path, progress: &'a Progress<'a>) -> Self {
        let mut last_use = HashMap::new();
        for (number, asset) in assets.iter().enumerate() {
            let used: BTreeSet<u32> = asset.mesh.materials().iter().copied().collect();
            let materials = used.iter().filter_map(|m| asset.materials.get(*m as usize));
            last_use.extend(materials.filter_map(texture_source).map(|source| (source, number)));
            asset.mesh.release();
        }
        Self {
            out_dir,
            progress,
            last_use,
            pending: Mutex::default(),
            result: Mutex::default(),
            done: AtomicU64::new(0),
            masks: AtomicU64::new(0),
            stopped: AtomicBool::new(false),
        }
    }

    fn build_asset(&self, number: usize, asset: &TextureAsset) -> Result<()> {
        let images = image_files(asset.folder)?;
        triangles_by_source(asset).into_par_iter().try_for_each(|(source, triangles)| {
            if self.stopped.load(Ordering::Relaxed) {
                return Err(Error::Interrupted);
            }
            self.build_source(number, asset, &images, source, &triangles)
        })
    }

    fn build_source(
        &self,
        number: usize,
        asset: &TextureAsset,
        images: &HashMap<String, PathBuf>,
        source: TextureSource,
        triangles: &[u32],
    ) -> Result<()> {
        let last = self.last_use[&source] == number;
        match self.add_uses(asset, images, &source, triangles, last) {
            Ok(None) => return Ok(()),
            Ok(Some(texture)) => {
                let mut result = self.result.lock().expect("no thread panicked");
                result.by_source.insert(source, texture.info);
                *(if texture.is_new { &mut result.written } else { &mut result.kept }) += 1;
            }
            Err(Error::Storage { path, source: cause }) if path.starts_with(self.out_dir) => return Err(Error::Storage { path, source: cause }),
            Err(cause) if last => self.count_missing(&source, &cause),
            Err(_) => return Ok(()),
        }
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        if !(self.progress)("textures", done, self.last_use.len() as u64) {
            self.stopped.store(true, Ordering::Relaxed);
            return Err(Error::Interrupted);
        }
        Ok(())
    }

    /// Adds one asset's triangles to a source's mask; with the last asset writes the file.
    fn add_uses(
        &self,
        asset: &TextureAsset,
        images: &HashMap<String, PathBuf>,
        source: &TextureSource,
        triangles: &[u32],
        last: bool,
    ) -> Result<Option<BuiltTexture>> {
        let limits = ImageLimits::default();
        let (path, image) = read_image(asset.folder, images, source.image.as_deref())?;
        let (alpha_path, alpha) = read_image(asset.folder, images, source.alpha.as_deref())?;
        let path = if image.is_empty() { alpha_path } else { path };
        let (width, height) = source::probe(&path, &image, &alpha, &limits)?;
        let before = self.pending.lock().expect("no thread panicked").remove(source);
        let mut mask = before.and_then(|runs| PixelMask::from_runs(width, height, &runs)).unwrap_or_else(|| PixelMask::empty(width, height));
        let uvs = asset.mesh.uvs();
        for triangle in triangles.iter().map(|t| *t as usize) {
            if mask.is_full() {
                break;
            }
            mark_triangle(&mut mask, uvs[triangle], asset.materials[asset.mesh.materials()[triangle] as usize].wrap);
        }
        if self.masks.fetch_add(1, Ordering::Relaxed) % MASKS_PER_RELEASE == MASKS_PER_RELEASE - 1 {
            asset.mesh.release();
        }
        if !last {
            self.pending.lock().expect("no thread panicked").insert(source.clone(), mask.to_runs());
            return Ok(None);
        }
        self.write(&path, &image, &alpha, &mask).map(Some)
    }

    fn write(&self, path: &Path, image: &[u8], alpha: &[u8], mask: &PixelMask) -> Result<BuiltTexture> {
        let runs = if mask.is_full() { Vec::new() } else { mask.to_runs() };
        let key = texture_key(image, alpha, &runs);
        let target = texture_path(self.out_dir, &key);
        let info = |f: &TextureFile| TextureInfo { key, width: f.width, height: f.height, has_alpha: f.has_alpha };
        if let Ok(file) = TextureFile::open_header(&target) {
            return Ok(BuiltTexture { info: info(&file), is_new: false });
        }
        let bytes = file::encode_texture(path, image, alpha, mask, &ImageLimits::default())?;
        file::write_texture(&target, &bytes)?;
        Ok(BuiltTexture { info: info(&TextureFile::open_header(&target)?), is_new: true })
    }

    fn count_missing(&self, source: &TextureSource, cause: &Error) {
        let reason = match cause {
            Error::Limit { .. } => "texture image over a limit",
            Error::Storage { .. } => "texture image cannot be read",
            _ => "texture image is missing or damaged",
        };
        let name = source.image.as_deref().or(source.alpha.as_deref()).unwrap_or_default();
        let mut result = self.result.lock().expect("no thread panicked");
        result.faults.insert(name.to_owned(), TextureFault::new(cause));
        let entry = result.missing.entry(reason.to_owned()).or_default();
        entry.count += 1;
        let example = format!("{name}: {cause}");
        // The first message in alphabetical order, so that the report does not depend on the order of threads.
        if entry.example.is_empty() || example < entry.example {
            entry.example = example;
        }
    }
}

/// A texture of the build.
struct BuiltTexture {
    info: TextureInfo,
    is_new: bool,
}

/// Groups the triangles of an asset by texture, in the order of the asset.
fn triangles_by_source(asset: &TextureAsset) -> Vec<(TextureSource, Vec<u32>)> {
    let sources: Vec<Option<TextureSource>> = asset.materials.iter().map(texture_source).collect();
    let mut numbers: BTreeMap<&TextureSource, usize> = BTreeMap::new();
    let slots: Vec<Option<usize>> = sources
        .iter()
        .map(|source| {
            let next = numbers.len();
            source.as_ref().map(|s| *numbers.entry(s).or_insert(next))
        })
        .collect();
    let slot_of = |material: &u32| slots.get(*material as usize).copied().flatten();
    let mut counts = vec![0; numbers.len()];
    asset.mesh.materials().iter().filter_map(slot_of).for_each(|slot| counts[slot] += 1);
    let mut groups: Vec<Vec<u32>> = counts.into_iter().map(Vec::with_capacity).collect();
    for (triangle, material) in asset.mesh.materials().iter().enumerate() {
        if let Some(slot) = slot_of(material) {
            groups[slot].push(triangle as u32);
        }
    }
    asset.mesh.release();
    numbers
        .into_iter()
        .map(|(source, slot)| (source.clone(), std::mem::take(&mut groups[slot])))
        .filter(|(_, triangles)| !triangles.is_empty())
        .collect()
}

/// Returns the image files of an asset by key (their names without extension).
fn image_files(folder: &Path) -> Result<HashMap<String, PathBuf>> {
    let folder = folder.join("textures");
    if !folder.exists() {
        return Ok(HashMap::new());
    }
    let entries = std::fs::read_dir(&folder).map_err(|e| Error::storage(&folder, e))?;
    let mut files: Vec<PathBuf> = entries.map(|e| e.map(|e| e.path()).map_err(|e| Error::storage(&folder, e))).collect::<Result<_>>()?;
    files.sort_unstable_by(|a, b| b.cmp(a));
    Ok(files.into_iter().filter_map(|p| Some((p.file_stem()?.to_str()?.to_owned(), p))).collect())
}

/// Returns path and bytes of an image of the asset; empty bytes when the material names none.
fn read_image(folder: &Path, images: &HashMap<String, PathBuf>, key: Option<&str>) -> Result<(PathBuf, Vec<u8>)> {
    let Some(key) = key else { return Ok((folder.to_path_buf(), Vec::new())) };
    let path = images.get(key).ok_or_else(|| Error::format(folder.join("textures").join(key), "no such image in the asset"))?;
    let bytes = std::fs::read(path).map_err(|e| Error::storage(path, e))?;
    if bytes.is_empty() {
        return Err(Error::format(path, "an empty file"));
    }
    Ok((path.clone(), bytes))
}

/// Decodes all images of an asset; returns those that cannot be used, by their keys.
pub fn find_damaged_images(folder: &Path, threads: usize) -> Result<BTreeMap<String, TextureFault>> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|e| Error::argument(format!("threads: {e}")))?;
    let images = image_files(folder)?;
    let fault = |key: &String| {
        let decoded = read_image(folder, &images, Some(key)).and_then(|(path, bytes)| decode(&path, &bytes, &ImageLimits::default()));
        decoded.err().map(|cause| (key.clone(), TextureFault::new(&cause)))
    };
    Ok(pool.install(|| images.par_iter().filter_map(|(key, _)| fault(key)).collect()))
}
