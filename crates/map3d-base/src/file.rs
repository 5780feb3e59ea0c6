//! Binary files: a header with magic, version and checksum, then sections aligned to 64 bytes (spec/scene.md). The only place that maps files.

use std::fs::File;
use std::hash::Hasher;
use std::path::Path;

use bytemuck::Pod;
use memmap2::Mmap;
use twox_hash::XxHash3_64;

use crate::error::{Error, Result};

pub const HEADER_BYTES: usize = 64;
pub const ALIGN: usize = 64;
/// Resident bytes of a mapping between two releases in a pass over it.
pub const RELEASED_BYTES: usize = 1 << 26;

/// Rounds up to the alignment of sections.
pub const fn aligned(bytes: usize) -> usize {
    bytes.div_ceil(ALIGN) * ALIGN
}

/// The first 16 bytes of every binary file.
pub fn header_start(magic: &[u8; 4], version: u32, checksum: u64) -> [u8; 16] {
    let mut out = [0; 16];
    out[..4].copy_from_slice(magic);
    out[4..8].copy_from_slice(&version.to_le_bytes());
    out[8..].copy_from_slice(&checksum.to_le_bytes());
    out
}

/// Computes the checksum of a body: xxh3-64 with seed 0.
pub fn checksum(body: &[u8]) -> u64 {
    XxHash3_64::oneshot(body)
}

/// As `checksum`; drops resident pages on the way.
fn mapped_checksum(map: &Mmap) -> u64 {
    let mut hasher = XxHash3_64::new();
    for piece in map[HEADER_BYTES..].chunks(RELEASED_BYTES) {
        hasher.write(piece);
        release(map);
    }
    hasher.finish()
}

/// Maps a file read-only. Nothing may change the file in place while it is mapped: map3d's writers write another file and rename it.
pub fn map(path: &Path) -> Result<Mmap> {
    let file = File::open(path).map_err(|e| Error::storage(path, e))?;
    // SAFETY: files of a workspace are written once under another name and renamed; a mapping never sees a write.
    unsafe { Mmap::map(&file) }.map_err(|e| Error::storage(path, e))
}

/// Drops resident pages of a mapping; they are re-read on access. A failure costs memory only.
pub fn release(map: &Mmap) {
    // SAFETY: the mapping is a read-only one of a file, so dropped pages are read again unchanged.
    let _ = unsafe { map.unchecked_advise(memmap2::UncheckedAdvice::DontNeed) };
}

/// Checks magic, version and, if asked, the checksum over everything after `HEADER_BYTES`.
pub fn check_header(path: &Path, bytes: &[u8], magic: &[u8; 4], version: u32, with_checksum: bool) -> Result<()> {
    if bytes.len() < HEADER_BYTES || &bytes[..4] != magic {
        return Err(Error::format(path, format!("not a {} file", String::from_utf8_lossy(magic))));
    }
    let found = u32::from_le_bytes(bytes[4..8].try_into().expect("4 bytes"));
    if found != version {
        return Err(Error::format(path, format!("version {found}, this program reads {version}")));
    }
    if with_checksum { compare(path, bytes, checksum(&bytes[HEADER_BYTES..])) } else { Ok(()) }
}

/// Checks magic, version and checksum of a mapped file of any size in little memory.
pub fn check_mapped(path: &Path, map: &Mmap, magic: &[u8; 4], version: u32) -> Result<()> {
    check_header(path, map, magic, version, false)?;
    compare(path, map, mapped_checksum(map))
}

/// Checks magic, version and checksum of a file of any of these formats (magic, version).
pub fn check_any(path: &Path, formats: &[(&[u8; 4], u32)]) -> Result<()> {
    let map = map(path)?;
    match formats.iter().find(|(magic, _)| map.starts_with(*magic)) {
        Some((magic, version)) => check_mapped(path, &map, magic, *version),
        None => Err(Error::format(path, format!("not a file of map3d: it begins with {:?}", &map[..map.len().min(4)]))),
    }
}

fn compare(path: &Path, bytes: &[u8], actual: u64) -> Result<()> {
    let stored = u64::from_le_bytes(bytes[8..16].try_into().expect("8 bytes"));
    match stored == actual {
        true => Ok(()),
        false => Err(Error::format(path, format!("checksum {actual:016x}, expected {stored:016x}: the file is damaged"))),
    }
}

/// Returns `count` records of `T` at `offset`, which must be aligned for `T`; fails for a file that is too short.
pub fn section<'a, T: Pod>(path: &Path, bytes: &'a [u8], offset: usize, count: usize) -> Result<&'a [T]> {
    let end = count.checked_mul(size_of::<T>()).and_then(|n| offset.checked_add(n));
    let slice = end.and_then(|end| bytes.get(offset..end));
    let slice = slice.ok_or_else(|| Error::format(path, format!("truncated: {count} records at byte {offset} of {}", bytes.len())))?;
    bytemuck::try_cast_slice(slice).map_err(|e| Error::format(path, format!("misaligned section at byte {offset}: {e}")))
}
