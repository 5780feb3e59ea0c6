//! Images that a document names: found, checked by their header, and keyed by their bytes.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use imagesize::ImageType;
use map3d_base::Result;
use sha2::{Digest, Sha256};

use crate::asset_folder::AssetFolder;
use crate::options::ReadOptions;
use crate::report::Log;

/// An image to be copied into the asset. `key`: first 32 hex digits of the SHA-256 of its bytes; `extension` says what the bytes are, whatever the name says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Texture {
    pub path: PathBuf,
    pub extension: &'static str,
    pub key: String,
    pub width_px: u32,
    pub height_px: u32,
    /// Some texels are transparent.
    pub transparent: bool,
}

/// All images of one document.
#[derive(Default)]
pub struct Textures {
    files: Vec<Texture>,
    by_name: HashMap<String, Option<usize>>,
    by_key: HashMap<String, usize>,
}

impl Textures {
    pub fn files(&self) -> &[Texture] {
        &self.files
    }

    /// The image that a name means, or `None` after a warning.
    pub fn get(&mut self, name: &str, folder: &mut AssetFolder, options: &ReadOptions, log: &mut Log) -> Result<Option<&Texture>> {
        if !self.by_name.contains_key(name) {
            let number = self.load(name, folder, options, log)?;
            self.by_name.insert(name.to_owned(), number);
        } else if self.by_name[name].is_none() {
            log.warn("image not usable", name)?;
        }
        Ok(self.by_name[name].map(|n| &self.files[n]))
    }

    fn load(&mut self, name: &str, folder: &mut AssetFolder, options: &ReadOptions, log: &mut Log) -> Result<Option<usize>> {
        let found = match folder.find(name) {
            Ok(found) => found,
            Err(refusal) => {
                log.warn(&format!("image: {}", refusal.reason()), name)?;
                return Ok(None);
            }
        };
        if let Some(oddity) = found.tolerated {
            log.note(oddity, name);
        }
        match inspect(&found.path, options) {
            Ok(texture) => Ok(Some(self.keep(texture))),
            Err(why) => {
                log.warn(&format!("image: {why}"), name)?;
                Ok(None)
            }
        }
    }

    /// Takes over an image that another document brought.
    pub fn adopt(&mut self, texture: &Texture) {
        self.keep(texture.clone());
    }

    fn keep(&mut self, texture: Texture) -> usize {
        *self.by_key.entry(texture.key.clone()).or_insert_with(|| {
            self.files.push(texture);
            self.files.len() - 1
        })
    }
}

/// Checks the header before the bytes are taken; the error is a reason for the report.
fn inspect(path: &Path, options: &ReadOptions) -> std::result::Result<Texture, String> {
    let unreadable = |e: std::io::Error| format!("unreadable ({})", e.kind());
    let mut file = BufReader::new(File::open(path).map_err(unreadable)?);
    let kind = imagesize::reader_type(&mut file).map_err(|_| "of an unknown format")?;
    let extension = extension_of(kind).ok_or("of an unsupported format")?;
    let size = kind.reader_size(&mut file).map_err(|_| "with a broken header")?;
    let (width, height) = (size.width as u64, size.height as u64);
    if width == 0 || height == 0 {
        return Err("of no size".into());
    }
    if width.max(height) > options.max_image_side_px {
        return Err(format!("side over the limit max_image_side_px = {}", options.max_image_side_px));
    }
    if width * height > options.max_image_px {
        return Err(format!("pixels over the limit max_image_px = {}", options.max_image_px));
    }
    Ok(Texture {
        path: path.to_path_buf(),
        extension,
        key: key_of(path).map_err(unreadable)?,
        width_px: width as u32,
        height_px: height as u32,
        transparent: extension == "png" && png_is_transparent(path),
    })
}

fn extension_of(kind: ImageType) -> Option<&'static str> {
    Some(match kind {
        ImageType::Jpeg => "jpg",
        ImageType::Png => "png",
        ImageType::Webp => "webp",
        ImageType::Tiff => "tif",
        ImageType::Bmp => "bmp",
        ImageType::Gif => "gif",
        ImageType::Tga => "tga",
        _ => return None,
    })
}

fn key_of(path: &Path) -> std::io::Result<String> {
    let mut file = File::open(path)?;
    let mut digest = Sha256::new();
    let mut buffer = vec![0; 1 << 16];
    loop {
        match file.read(&mut buffer)? {
            0 => return Ok(digest.finalize().iter().take(16).map(|b| format!("{b:02x}")).collect()),
            n => digest.update(&buffer[..n]),
        }
    }
}

/// Whether a PNG has a texel that is not opaque; read row by row. A broken image counts as opaque: whoever decodes it will say so.
fn png_is_transparent(path: &Path) -> bool {
    let Ok(file) = File::open(path) else { return false };
    let mut decoder = png::Decoder::new(BufReader::new(file));
    decoder.set_transformations(png::Transformations::normalize_to_color8() | png::Transformations::ALPHA);
    let Ok(mut reader) = decoder.read_info() else { return false };
    let info = reader.info();
    let has_alpha = matches!(info.color_type, png::ColorType::Rgba | png::ColorType::GrayscaleAlpha);
    if !has_alpha && info.trns.is_none() {
        return false;
    }
    let (color, _) = reader.output_color_type();
    let samples = color.samples();
    while let Ok(Some(row)) = reader.next_row() {
        if row.data().chunks_exact(samples).any(|texel| texel[samples - 1] < 255) {
            return true;
        }
    }
    false
}
