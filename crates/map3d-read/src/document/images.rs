//! Images of a document: located, checked by their header, and identified by the hash of their bytes.

use std::borrow::Cow;
use std::collections::HashMap;
use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Cursor, Seek};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use imagesize::ImageType;
use map3d_base::Result;
use map3d_base::reason::{Message, Reason};
use map3d_image::decode::check::{ImageFault, find_fault};
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

    fn read(&self) -> io::Result<Cow<'_, [u8]>> {
        match self {
            Self::File(path) => fs::read(path).map(Cow::Owned),
            Self::Bytes(bytes) => Ok(Cow::Borrowed(bytes)),
        }
    }

    /// The path for messages.
    fn path(&self) -> &Path {
        match self {
            Self::File(path) => path,
            Self::Bytes(_) => Path::new("image in the document"),
        }
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
    /// Its name in the document; empty for an image in the document itself.
    pub name: String,
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
            Ok(image) => Ok(Some(self.add(DocumentImage { name: name.to_owned(), ..image }))),
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
    /// Checks the header, then whether the file is whole, and hashes the bytes. The error is the reason for the report.
    pub fn inspect(source: ImageSource, options: &ReadOptions) -> std::result::Result<Self, Message> {
        let (extension, width, height) = check_header(&source, options)?;
        let bytes = source.read().map_err(unreadable)?;
        match find_fault(source.path(), &bytes) {
            Some(ImageFault::Damaged) => return Err(Reason::ImageDamaged.into()),
            Some(ImageFault::Kind(kind)) => return Err(Reason::ImageKindNotRead.with("kind", kind)),
            None => {}
        }
        let key = Sha256::digest(&bytes).iter().take(16).map(|b| format!("{b:02x}")).collect();
        let transparent = extension == "png" && is_png_transparent(&bytes);
        drop(bytes);
        Ok(Self { source, extension, key, width_px: width, height_px: height, transparent, name: String::new() })
    }
}

fn unreadable(e: io::Error) -> Message {
    Reason::ImageUnreadable.with("error", e.kind().to_string())
}

/// Returns the file extension of the detected type, width and height.
fn check_header(source: &ImageSource, options: &ReadOptions) -> std::result::Result<(&'static str, u32, u32), Message> {
    let mut input = source.open().map_err(unreadable)?;
    let kind = imagesize::reader_type(&mut input).map_err(|_| Reason::ImageFormatUnknown)?;
    let extension = extension_for(kind).ok_or(Reason::ImageFormatNotRead)?;
    let size = kind.reader_size(&mut input).map_err(|_| Reason::ImageHeaderInvalid)?;
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
    Ok((extension, width as u32, height as u32))
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

/// Returns true if any texel of a PNG is not opaque. Reads row by row. Treats a damaged image as opaque: the scene build reports it when it decodes it.
fn is_png_transparent(bytes: &[u8]) -> bool {
    let mut decoder = png::Decoder::new(Cursor::new(bytes));
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
