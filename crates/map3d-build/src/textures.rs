//! The texture step of a build: reads only what changed, and assets that share an image with an asset that changed.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::mpsc;

use map3d_base::asset::Material;
use map3d_base::{Error, Result};
use map3d_texture::{TextureAsset, TextureFile, TextureKeys, TextureSource, build_textures, texture_path, texture_source};

use crate::assets::{Asset, Assets};
use crate::{BuildReport, BuildRequest, Progress};

/// Builds the textures of assets without a summary and of assets that share an image with them; returns the keys of all textures. Invalidates
/// summaries that name another key of one of their textures.
pub(crate) fn build_changed(
    folder: &Path,
    assets: &mut Assets,
    request: &BuildRequest,
    report: &mut BuildReport,
    progress: Progress,
) -> Result<TextureKeys> {
    let out_dir = folder.join("textures");
    let stale = find_stale_sources(assets, &out_dir)?;
    let chosen = select_assets(assets, &stale)?;
    let list: Vec<TextureAsset> = chosen.iter().map(|(k, materials)| asset_of(assets.get(*k), materials)).collect();
    let mut keys = if list.is_empty() { TextureKeys::default() } else { run_texture_build(&list, &out_dir, request.threads, progress)? };
    assets.invalidate(|summary| {
        summary.details.textures.iter().any(|t| stale.contains(&t.source()) && keys.by_source.get(&t.source()) != t.info().as_ref())
    });
    let known = assets.summaries().flat_map(|s| &s.details.textures).filter(|t| !stale.contains(&t.source()));
    let known: Vec<_> = known.filter_map(|t| Some((t.source(), t.info()?))).collect();
    keys.by_source.extend(known);
    report.textures = keys.by_source.len() as u64;
    report.textures_kept = report.textures - keys.written;
    report.texture_faults = keys.faults.clone();
    report.texture_warnings =
        keys.missing.iter().map(|(reason, missing)| (reason.clone(), format!("{}, first: {}", missing.count, missing.example))).collect();
    Ok(keys)
}

/// Returns the sources whose mask or image may have changed, and those without a file of today's version.
fn find_stale_sources(assets: &mut Assets, out_dir: &Path) -> Result<BTreeSet<TextureSource>> {
    let mut stale: BTreeSet<TextureSource> =
        assets.previous().flat_map(|s| &s.details.textures).map(crate::asset_summary::SummaryTexture::source).collect();
    let is_there = |key: Option<[u8; 16]>| key.is_some_and(|k| TextureFile::open_header(&texture_path(out_dir, &k)).is_ok());
    stale.extend(assets.summaries().flat_map(|s| &s.details.textures).filter(|t| !is_there(t.key)).map(crate::asset_summary::SummaryTexture::source));
    for k in assets.without_summary() {
        stale.extend(used_sources(assets.open(k)?));
    }
    Ok(stale)
}

/// Returns the sources that triangles of an asset use.
pub(crate) fn used_sources(asset: &Asset) -> BTreeSet<TextureSource> {
    let mut used = vec![false; asset.materials.len()];
    asset.mesh.materials().iter().for_each(|m| used[*m as usize] = true);
    asset.mesh.release();
    asset.materials.iter().zip(used).filter(|(_, used)| *used).filter_map(|(m, _)| texture_source(m)).collect()
}

/// Returns the assets that use a stale source, with their materials; materials of other sources lose their texture.
fn select_assets(assets: &mut Assets, stale: &BTreeSet<TextureSource>) -> Result<Vec<(usize, Vec<Material>)>> {
    let sharing = |k: &usize| assets.summary(*k).is_none_or(|s| s.details.textures.iter().any(|t| stale.contains(&t.source())));
    let numbers: Vec<usize> = (0..assets.len()).filter(sharing).collect();
    let mut out = Vec::new();
    for k in numbers {
        let mut materials = assets.open(k)?.materials.clone();
        for m in materials.iter_mut().filter(|m| texture_source(m).is_some_and(|s| !stale.contains(&s))) {
            (m.texture, m.alpha) = (None, None);
        }
        out.push((k, materials));
    }
    Ok(out)
}

fn asset_of<'a>(asset: &'a Asset, materials: &'a [Material]) -> TextureAsset<'a> {
    TextureAsset { folder: &asset.folder, mesh: &asset.mesh, materials }
}

/// Runs the texture build on its own threads; this thread reports progress.
fn run_texture_build(list: &[TextureAsset], out_dir: &Path, threads: usize, progress: Progress) -> Result<TextureKeys> {
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
            // The worker waits for the answer.
            let _ = answer.send(progress(&stage, done, total));
        }
        worker.join().map_err(|_| Error::argument("the texture build panicked"))?
    })
}
