//! The texture step: only what changed is read, also of assets that share an image with one that changed.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::mpsc;

use map3d_base::asset::Material;
use map3d_base::{Error, Result};
use map3d_texture::{TextureAsset, TextureKeys, TextureSource, build_textures, source_of, texture_path};

use super::assets::{Asset, Assets};
use super::{BuildReport, BuildRequest, Progress};

/// Builds the textures of assets without a survey and of whoever shares an image with them; returns the keys of all. Surveys that knew another key of
/// one of their textures go.
pub(super) fn settle(
    folder: &Path,
    assets: &mut Assets,
    request: &BuildRequest,
    report: &mut BuildReport,
    progress: Progress,
) -> Result<TextureKeys> {
    let out_dir = folder.join("textures");
    let open = open_sources(assets, &out_dir)?;
    let chosen = choose(assets, &open)?;
    let list: Vec<TextureAsset> = chosen.iter().map(|(k, materials)| asset_of(assets.get(*k), materials)).collect();
    let mut keys = if list.is_empty() { TextureKeys::default() } else { run(&list, &out_dir, request.threads, progress)? };
    assets.drop_surveys(|survey| {
        survey.facts.textures.iter().any(|t| open.contains(&t.source()) && keys.by_source.get(&t.source()) != t.info().as_ref())
    });
    let known = assets.surveys().flat_map(|s| &s.facts.textures).filter(|t| !open.contains(&t.source()));
    let known: Vec<_> = known.filter_map(|t| Some((t.source(), t.info()?))).collect();
    keys.by_source.extend(known);
    report.textures = keys.by_source.len() as u64;
    report.textures_kept = report.textures - keys.written;
    report.texture_warnings = keys.missing.iter().map(|(reason, (count, example))| (reason.clone(), format!("{count}, first: {example}"))).collect();
    Ok(keys)
}

/// Sources whose mask or image may have changed, and those that have no file.
fn open_sources(assets: &mut Assets, out_dir: &Path) -> Result<BTreeSet<TextureSource>> {
    let mut open: BTreeSet<TextureSource> = assets.former().flat_map(|s| &s.facts.textures).map(super::survey::KnownTexture::source).collect();
    let is_there = |key: Option<[u8; 16]>| key.is_some_and(|k| texture_path(out_dir, &k).exists());
    open.extend(assets.surveys().flat_map(|s| &s.facts.textures).filter(|t| !is_there(t.key)).map(super::survey::KnownTexture::source));
    for k in assets.without_survey() {
        open.extend(used_sources(assets.open(k)?));
    }
    Ok(open)
}

/// What the triangles of an asset use, each once.
pub(super) fn used_sources(asset: &Asset) -> BTreeSet<TextureSource> {
    let mut used = vec![false; asset.materials.len()];
    asset.mesh.materials().iter().for_each(|m| used[*m as usize] = true);
    asset.mesh.release();
    asset.materials.iter().zip(used).filter(|(_, used)| *used).filter_map(|(m, _)| source_of(m)).collect()
}

/// Assets that use an open source, with their materials; those of other sources are made plain.
fn choose(assets: &mut Assets, open: &BTreeSet<TextureSource>) -> Result<Vec<(usize, Vec<Material>)>> {
    let sharing = |k: &usize| assets.survey(*k).is_none_or(|s| s.facts.textures.iter().any(|t| open.contains(&t.source())));
    let numbers: Vec<usize> = (0..assets.len()).filter(sharing).collect();
    let mut out = Vec::new();
    for k in numbers {
        let mut materials = assets.open(k)?.materials.clone();
        for m in materials.iter_mut().filter(|m| source_of(m).is_some_and(|s| !open.contains(&s))) {
            (m.texture, m.alpha) = (None, None);
        }
        out.push((k, materials));
    }
    Ok(out)
}

fn asset_of<'a>(asset: &'a Asset, materials: &'a [Material]) -> TextureAsset<'a> {
    TextureAsset { folder: &asset.folder, mesh: &asset.mesh, materials }
}

/// Runs the texture build on threads of its own, its progress handed on by this one.
fn run(list: &[TextureAsset], out_dir: &Path, threads: usize, progress: Progress) -> Result<TextureKeys> {
    let (send, receive) = mpsc::sync_channel::<(String, u64, u64, mpsc::Sender<bool>)>(64);
    std::thread::scope(|scope| {
        let worker = scope.spawn(move || {
            let ask = |stage: &str, done: u64, total: u64| {
                let (answer, answered) = mpsc::channel();
                send.send((stage.to_owned(), done, total, answer)).is_ok() && answered.recv().unwrap_or(false)
            };
            build_textures(list, out_dir, threads, &ask)
        });
        for (stage, done, total, answer) in receive {
            // The worker waits for the answer, so it is there to take it.
            let _ = answer.send(progress(&stage, done, total));
        }
        worker.join().map_err(|_| Error::argument("the texture build panicked"))?
    })
}
