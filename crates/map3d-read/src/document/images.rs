//! Images of a document: located, checked by their header, and identified by the hash of their bytes.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, Read, Seek};
use std::path::PathBuf;
use std::sync::Arc;

use imagesize::ImageType;
use map3d_base::Result;
use map3d_base::reason::{Message, Reason};
use sha2::{Digest, Sha256};

use super::asset_folder::{AssetFolder, IMAGE};
use super::options::ReadOptions;
use super::report_builder::ReportBuilder;

/// Where an image is: in a file of its own, or in the document.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ImageSource {
    File(PathBuf),
    Bytes(Arc<[u8]>),
}

trait ImageInput: BufRead + Seek {}
impl<T: BufRead + Seek> ImageInput for T {}

impl ImageSource {
    fn open(&self) -> io::Result<Box<dyn ImageInput + '_>> {
        Ok(match self {
            Self::File(path) => Box::new(BufReader::new(File::open(path)?)),
            Self::Bytes(bytes) => Box::new(Cursor::new(&**bytes)),
        })
    }
}

/// An image to be copied into the asset.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DocumentImage {
    pub source: ImageSource,
    /// File extension for the detected image type; may differ from the extension of its file.
    pub extension: &'static str,
    /// The first 32 hex digits of the SHA-256 of the bytes.
    pub key: String,
    pub width_px: u32,
    pub height_px: u32,
    /// True if any texel is not opaque. Detected for PNG only.
    pub transparent: bool,
}

/// All images of one document, each stored once.
#[derive(Default)]
pub struct DocumentImages {
    files: Vec<DocumentImage>,
    /// Index into `files` by name in the document; `None` for unusable images.
    by_name: HashMap<String, Option<usize>>,
    by_key: HashMap<String, usize>,
}

impl DocumentImages {
    pub fn files(&self) -> &[DocumentImage] {
        &self.files
    }

    /// Returns the image that a name in the document refers to. Returns `None` after a warning if the image is unusable.
    pub fn get(&mut self, name: &str, folder: &mut AssetFolder, options: &ReadOptions, report: &mut ReportBuilder) -> Result<Option<&DocumentImage>> {
        if !self.by_name.contains_key(name) {
            let index = self.load(name, folder, options, report)?;
            self.by_name.insert(name.to_owned(), index);
        } else if self.by_name[name].is_none() {
            report.warn(Reason::ImageUnusable, name)?;
        }
        Ok(self.by_name[name].map(|n| &self.files[n]))
    }

    fn load(&mut self, name: &str, folder: &mut AssetFolder, options: &ReadOptions, report: &mut ReportBuilder) -> Result<Option<usize>> {
        let file = match folder.find(name) {
            Ok(file) => file,
            Err(error) => {
                report.warn(error.reason(IMAGE), name)?;
                return Ok(None);
            }
        };
        if let Some(note) = file.note {
            report.note(note, name);
        }
        match DocumentImage::inspect(ImageSource::File(file.path), options) {
            Ok(image) => Ok(Some(self.add(image))),
            Err(reason) => {
                report.warn(reason, name)?;
                Ok(None)
            }
        }
    }

    /// Adds an image unless one with the same bytes exists. Returns its index.
    pub fn add(&mut self, image: DocumentImage) -> usize {
        *self.by_key.entry(image.key.clone()).or_insert_with(|| {
            self.files.push(image);
            self.files.len() - 1
        })
    }
}

impl DocumentImage {
    /// Reads and checks the header, then hashes the bytes. The error is the reason for the report.
    pub fn inspect(source: ImageSource, options: &ReadOptions) -> std::result::Result<Self, Message> {
        let unreadable = |e: io::Error| Reason::ImageUnreadable.with("error", e.kind().to_string());
        let mut input = source.open().map_err(unreadable)?;
        let kind = imagesize::reader_type(&mut input).map_err(|_| Reason::ImageFormatUnknown)?;
        let extension = extension_for(kind).ok_or(Reason::ImageFormatNotRead)?;
        let size = kind.reader_size(&mut input).map_err(|_| Reason::ImageHeaderInvalid)?;
        drop(input);
        let (width, height) = (size.width as u64, size.height as u64);
        if width == 0 || height == 0 {
            return Err(Reason::ImageWithoutPixels.into());
        }
        if width.max(height) > options.max_image_side_px {
            return Err(Reason::ImageSideOverLimit.with("limit", options.max_image_side_px));
        }
        if width * height > options.max_image_px {
            return Err(Reason::ImagePixelsOverLimit.with("limit", options.max_image_px));
        }
        let key = compute_key(&source).map_err(unreadable)?;
        let transparent = extension == "png" && is_png_transparent(&source);
        Ok(Self { source, extension, key, width_px: width as u32, height_px: height as u32, transparent })
    }
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

fn compute_key(source: &ImageSource) -> io::Result<String> {
    let mut input = source.open()?;
    let mut digest = Sha256::new();
    let mut buffer = vec![0; 1 << 16];
    loop {
        match input.read(&mut buffer)? {
            0 => return Ok(digest.finalize().iter().take(16).map(|b| format!("{b:02x}")).collect()),
            n => digest.update(&buffer[..n]),
        }
    }
}

/// Returns true if any texel of a PNG is not opaque. Reads row by row. Treats a damaged image as opaque: the scene build reports it when it decodes it.
fn is_png_transparent(source: &ImageSource) -> bool {
    let Ok(input) = source.open() else { return false };
    let mut decoder = png::Decoder::new(input);
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
