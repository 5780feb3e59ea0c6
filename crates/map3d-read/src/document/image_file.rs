//! Image files of a document: located, checked by their header, and identified by the hash of their bytes.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use imagesize::ImageType;
use map3d_base::Result;
use sha2::{Digest, Sha256};

use super::asset_folder::AssetFolder;
use super::options::ReadOptions;
use super::report_builder::ReportBuilder;

/// An image to be copied into the asset.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImageFile {
    pub path: PathBuf,
    /// File extension for the detected image type; may differ from the extension of `path`.
    pub extension: &'static str,
    /// The first 32 hex digits of the SHA-256 of the file's bytes.
    pub key: String,
    pub width_px: u32,
    pub height_px: u32,
    /// True if any texel is not opaque. Detected for PNG only.
    pub transparent: bool,
}

/// All images of one document, each stored once.
#[derive(Default)]
pub struct ImageFiles {
    files: Vec<ImageFile>,
    /// Index into `files` by name in the document; `None` for unusable images.
    by_name: HashMap<String, Option<usize>>,
    by_key: HashMap<String, usize>,
}

impl ImageFiles {
    pub fn files(&self) -> &[ImageFile] {
        &self.files
    }

    /// Returns the image that a name in the document refers to. Returns `None` after a warning if the image is unusable.
    pub fn get(&mut self, name: &str, folder: &mut AssetFolder, options: &ReadOptions, report: &mut ReportBuilder) -> Result<Option<&ImageFile>> {
        if !self.by_name.contains_key(name) {
            let index = self.load(name, folder, options, report)?;
            self.by_name.insert(name.to_owned(), index);
        } else if self.by_name[name].is_none() {
            report.warn("unusable image", name)?;
        }
        Ok(self.by_name[name].map(|n| &self.files[n]))
    }

    fn load(&mut self, name: &str, folder: &mut AssetFolder, options: &ReadOptions, report: &mut ReportBuilder) -> Result<Option<usize>> {
        let file = match folder.find(name) {
            Ok(file) => file,
            Err(error) => {
                report.warn(&format!("image: {}", error.reason()), name)?;
                return Ok(None);
            }
        };
        if let Some(oddity) = file.oddity {
            report.note(oddity, name);
        }
        match inspect(&file.path, options) {
            Ok(image) => Ok(Some(self.add(image))),
            Err(reason) => {
                report.warn(&format!("image: {reason}"), name)?;
                Ok(None)
            }
        }
    }

    /// Adds an image unless one with the same bytes exists. Returns its index.
    pub fn add(&mut self, image: ImageFile) -> usize {
        *self.by_key.entry(image.key.clone()).or_insert_with(|| {
            self.files.push(image);
            self.files.len() - 1
        })
    }
}

/// Reads and checks the header, then hashes the file. The error is the reason for the report.
fn inspect(path: &Path, options: &ReadOptions) -> std::result::Result<ImageFile, String> {
    let unreadable = |e: std::io::Error| format!("unreadable ({})", e.kind());
    let mut file = BufReader::new(File::open(path).map_err(unreadable)?);
    let kind = imagesize::reader_type(&mut file).map_err(|_| "unknown format")?;
    let extension = extension_for(kind).ok_or("unsupported format")?;
    let size = kind.reader_size(&mut file).map_err(|_| "invalid header")?;
    let (width, height) = (size.width as u64, size.height as u64);
    if width == 0 || height == 0 {
        return Err("no pixels".into());
    }
    if width.max(height) > options.max_image_side_px {
        return Err(format!("side over the limit max_image_side_px = {}", options.max_image_side_px));
    }
    if width * height > options.max_image_px {
        return Err(format!("pixels over the limit max_image_px = {}", options.max_image_px));
    }
    Ok(ImageFile {
        path: path.to_path_buf(),
        extension,
        key: compute_key(path).map_err(unreadable)?,
        width_px: width as u32,
        height_px: height as u32,
        transparent: extension == "png" && is_png_transparent(path),
    })
}

fn extension_for(kind: ImageType) -> Option<&'static str> {
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

fn compute_key(path: &Path) -> std::io::Result<String> {
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

/// Returns true if any texel of a PNG is not opaque. Reads row by row. Treats a damaged image as opaque: the scene build reports it when it decodes it.
fn is_png_transparent(path: &Path) -> bool {
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
