//! `.m3t` files (spec/scene.md, Texture): the source bytes, the usage mask, and the levels from 1 on, packed.

use std::cell::RefCell;
use std::fs::{self, File};
use std::io::Read;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use map3d_base::file::{self, HEADER_BYTES, aligned};
use map3d_base::{Error, Result};

use crate::store::level::Level;
use crate::store::mips::{first_mip, level_count, level_size, next_mip};
use crate::store::packed::{pack, unpack};
use crate::store::source::{self, Level0Decoder};
use map3d_image::ImageLimits;
use map3d_image::PixelMask;
use map3d_image::Raster;
use map3d_image::decode::reading_version;

pub const TEXTURE_MAGIC: &[u8; 4] = b"M3DT";
pub const TEXTURE_VERSION: u32 = 2;
const FLAG_ALPHA: u32 = 1;
const FLAG_MASK: u32 = 2;
const SECTIONS: usize = 17;
const IMAGE_SECTION: usize = 0;
const ALPHA_SECTION: usize = 1;
const MASK_SECTION: usize = 2;
const TABLE_BYTES: usize = SECTIONS * 16;
/// The section of level 1.
const FIRST_LEVEL_SECTION: usize = 3;
/// Greatest distance from a used texel, in texels, at which level 0 is sampled: half a pixel of `MAX_TAPS` texels of level 1 to the side of the
/// triangle and half a footprint beyond it, both along a diagonal.
const SAMPLED_REACH: u32 = 64;

/// Binary key of a texture: xxh3-128.
pub type TextureKey = [u8; 16];

/// Returns a key in lower-case hex, as in file names.
pub fn hex(key: &TextureKey) -> String {
    key.iter().map(|b| format!("{b:02x}")).collect()
}

/// Returns `<folder>/<aa>/<key>.m3t`.
pub fn texture_path(folder: &Path, key: &TextureKey) -> PathBuf {
    let name = hex(key);
    folder.join(&name[..2]).join(format!("{name}.m3t"))
}

/// Computes the key of an image, an alpha image and the runs of a usage mask (none when every texel is used), each after its length as u64. Behind
/// them is the version of the reading of the images, unless that is 0.
pub fn texture_key(image: &[u8], alpha: &[u8], runs: &[u8]) -> TextureKey {
    let mut hash = twox_hash::XxHash3_128::with_seed(0);
    for part in [image, alpha, runs] {
        hash.write(&(part.len() as u64).to_le_bytes());
        hash.write(part);
    }
    let version = reading_version(image).max(reading_version(alpha));
    if version > 0 {
        hash.write(&[version]);
    }
    hash.finish_128().to_be_bytes()
}

/// Decodes a texture and returns its file's bytes.
pub fn encode_texture(path: &Path, image: &[u8], alpha: &[u8], mask: &PixelMask, limits: &ImageLimits) -> Result<Vec<u8>> {
    let masked = !mask.is_full();
    let level_0 = Level0Decoder::default().decode(path, image, alpha, masked.then_some((mask, u32::MAX)), limits)?;
    let levels = level_count(level_0.width, level_0.height);
    let (width, height, has_alpha) = (level_0.width, level_0.height, level_0.has_alpha());
    let mut sections = vec![image.to_vec(), alpha.to_vec(), if masked { mask.to_runs() } else { Vec::new() }];
    if levels > 1 {
        let mut mip = first_mip(&level_0);
        sections.push(pack(&Level::first_mip_of(&level_0, has_alpha), has_alpha));
        for _ in 2..levels {
            mip = next_mip(&mip);
            sections.push(pack(&Level::of_image(&mip.to_raster(), has_alpha), has_alpha));
        }
    }
    let flags = u32::from(has_alpha) * FLAG_ALPHA + u32::from(masked) * FLAG_MASK;
    Ok(assemble([width, height, levels, flags], &sections))
}

fn assemble(numbers: [u32; 4], sections: &[Vec<u8>]) -> Vec<u8> {
    let body = aligned(TABLE_BYTES) + sections.iter().map(|s| aligned(s.len())).sum::<usize>();
    let mut out = Vec::with_capacity(HEADER_BYTES + body);
    out.resize(HEADER_BYTES + aligned(TABLE_BYTES), 0);
    for (k, section) in sections.iter().enumerate() {
        let entry = HEADER_BYTES + k * 16;
        let offset = out.len() as u64;
        out[entry..entry + 8].copy_from_slice(&offset.to_le_bytes());
        out[entry + 8..entry + 16].copy_from_slice(&(section.len() as u64).to_le_bytes());
        out.extend_from_slice(section);
        out.resize(out.len().next_multiple_of(file::ALIGN), 0);
    }
    let checksum = file::checksum(&out[HEADER_BYTES..]);
    out[..16].copy_from_slice(&file::header_start(TEXTURE_MAGIC, TEXTURE_VERSION, checksum));
    for (k, n) in numbers.into_iter().enumerate() {
        out[16 + 4 * k..20 + 4 * k].copy_from_slice(&n.to_le_bytes());
    }
    out
}

/// Writes a temporary file and renames it, so that a reader never sees half a file.
pub fn write_texture(path: &Path, bytes: &[u8]) -> Result<()> {
    let folder = path.parent().expect("texture_path has a folder");
    fs::create_dir_all(folder).map_err(|e| Error::storage(folder, e))?;
    let part = path.with_extension("m3t.part");
    fs::write(&part, bytes).map_err(|e| Error::storage(&part, e))?;
    fs::rename(&part, path).map_err(|e| Error::storage(path, e))
}

/// An open texture file: header and table checked, sections read on demand.
#[derive(Debug)]
pub struct TextureFile {
    path: PathBuf,
    pub width: u32,
    pub height: u32,
    pub levels: u32,
    pub has_alpha: bool,
    masked: bool,
    sections: [(u64, u64); SECTIONS],
}

impl TextureFile {
    /// Opens a file and verifies its checksum.
    pub fn open(path: &Path) -> Result<Self> {
        READER.with_borrow_mut(|Reader { bytes, .. }| {
            bytes.clear();
            File::open(path).and_then(|mut file| file.read_to_end(bytes)).map_err(|e| Error::storage(path, e))?;
            file::check_header(path, bytes, TEXTURE_MAGIC, TEXTURE_VERSION, true)?;
            let texture = Self::parse(path, bytes, bytes.len() as u64);
            if bytes.capacity() > KEPT_BYTES {
                *bytes = Vec::new();
            }
            texture
        })
    }

    /// Opens a file without reading its sections or verifying the checksum.
    pub fn open_header(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(|e| Error::storage(path, e))?;
        let length = file.metadata().map_err(|e| Error::storage(path, e))?.len();
        let mut head = vec![0; (HEADER_BYTES + TABLE_BYTES).min(length as usize)];
        file.read_exact_at(&mut head, 0).map_err(|e| Error::storage(path, e))?;
        file::check_header(path, &head, TEXTURE_MAGIC, TEXTURE_VERSION, false)?;
        Self::parse(path, &head, length)
    }

    fn parse(path: &Path, head: &[u8], length: u64) -> Result<Self> {
        if head.len() < HEADER_BYTES + TABLE_BYTES {
            return Err(Error::format(path, format!("truncated: {length} bytes")));
        }
        let u32_at = |at: usize| u32::from_le_bytes(head[at..at + 4].try_into().expect("4 bytes"));
        let [width, height, levels, flags] = [16, 20, 24, 28].map(u32_at);
        if width == 0 || height == 0 || levels != level_count(width, height) || levels as usize > SECTIONS - FIRST_LEVEL_SECTION + 1 {
            return Err(Error::format(path, format!("{width} × {height} px with {levels} levels")));
        }
        let u64_at = |at: usize| u64::from_le_bytes(head[at..at + 8].try_into().expect("8 bytes"));
        let sections: [(u64, u64); SECTIONS] = std::array::from_fn(|k| (u64_at(HEADER_BYTES + 16 * k), u64_at(HEADER_BYTES + 16 * k + 8)));
        let texture =
            Self { path: path.to_path_buf(), width, height, levels, has_alpha: flags & FLAG_ALPHA != 0, masked: flags & FLAG_MASK != 0, sections };
        texture.validate(length)?;
        Ok(texture)
    }

    fn validate(&self, length: u64) -> Result<()> {
        for (k, (offset, bytes)) in self.sections.iter().enumerate() {
            if offset.checked_add(*bytes).is_none_or(|end| end > length) {
                return Err(Error::format(&self.path, format!("section {k} ends after the file's {length} bytes")));
            }
        }
        Ok(())
    }

    /// Reads a level ≥ 1, ready to sample.
    pub fn stored_level(&self, level: u32) -> Result<Level> {
        assert!((1..self.levels).contains(&level), "level {level} is not stored");
        READER.with_borrow_mut(|Reader { bytes: frame, .. }| {
            self.read_section(FIRST_LEVEL_SECTION + level as usize - 1, frame)?;
            let (w, h) = level_size(self.width, self.height, level);
            unpack(frame, w, h, self.has_alpha).map_err(|what| Error::format(&self.path, format!("level {level}: {what}")))
        })
    }

    /// Decodes level 0, ready to sample.
    pub(super) fn decoded_level_0(&self) -> Result<Level> {
        READER.with_borrow_mut(|reader| {
            let image = self.decode(reader, SAMPLED_REACH)?;
            let level = Level::of_image(&image, self.has_alpha);
            reader.decoder.recycle(image);
            Ok(level)
        })
    }

    /// Computes any level as sRGB bytes from the source image.
    pub fn level(&self, level: u32) -> Result<Raster> {
        if level >= self.levels {
            return Err(Error::argument(format!("level {level} of {}: expected 0 to {}", self.path.display(), self.levels - 1)));
        }
        let mut reader = Reader::default();
        if level == 0 {
            return self.decode(&mut reader, SAMPLED_REACH);
        }
        let mip = first_mip(&self.decode(&mut reader, u32::MAX)?);
        Ok((1..level).fold(mip, |mip, _| next_mip(&mip)).to_raster())
    }

    /// Decodes the source image and fills its unused texels within a distance of the used ones.
    fn decode(&self, reader: &mut Reader, reach: u32) -> Result<Raster> {
        let Reader { decoder, bytes: image } = reader;
        self.read_section(IMAGE_SECTION, image)?;
        let alpha = self.section(ALPHA_SECTION)?;
        let mask = if self.masked { Some(self.mask()?) } else { None };
        let limits = ImageLimits::default();
        if source::probe(&self.path, image, &alpha, &limits)? != (self.width, self.height) {
            return Err(Error::format(&self.path, "its image and its header differ in size"));
        }
        decoder.decode(&self.path, image, &alpha, mask.as_ref().map(|m| (m, reach)), &limits)
    }

    fn mask(&self) -> Result<PixelMask> {
        let runs = self.section(MASK_SECTION)?;
        PixelMask::from_runs(self.width, self.height, &runs)
            .ok_or_else(|| Error::format(&self.path, "the runs of its usage mask do not add up to the image"))
    }

    fn section(&self, k: usize) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        self.read_section(k, &mut bytes)?;
        Ok(bytes)
    }

    fn read_section(&self, k: usize, bytes: &mut Vec<u8>) -> Result<()> {
        let (offset, length) = self.sections[k];
        bytes.resize(length as usize, 0);
        let file = File::open(&self.path).map_err(|e| Error::storage(&self.path, e))?;
        file.read_exact_at(bytes, offset).map_err(|e| Error::storage(&self.path, e))
    }
}

thread_local! {
    /// Buffers for the files that a thread reads one after another: new pages for each would take a third of the time.
    static READER: RefCell<Reader> = RefCell::default();
}

#[derive(Default)]
struct Reader {
    decoder: Level0Decoder,
    /// Content of a file or of one of its sections.
    bytes: Vec<u8>,
}

/// Files are read into a buffer that is kept up to this size.
const KEPT_BYTES: usize = 4 << 20;
