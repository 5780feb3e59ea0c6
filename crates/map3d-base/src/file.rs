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
/// Memory of a mapping that a pass over it lets go of at a time.
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

/// Checksum of a body: xxh3-64 with seed 0.
pub fn checksum(body: &[u8]) -> u64 {
    XxHash3_64::oneshot(body)
}

/// The same, letting go of the mapping's memory on the way.
fn mapped_checksum(map: &Mmap) -> u64 {
    let mut hasher = XxHash3_64::new();
    for piece in map[HEADER_BYTES..].chunks(RELEASED_BYTES) {
        hasher.write(piece);
        release(map);
    }
    hasher.finish()
}

/// Maps a file read-only. The file must not be changed in place while mapped: map3d's writers write elsewhere and rename.
pub fn map(path: &Path) -> Result<Mmap> {
    let file = File::open(path).map_err(|e| Error::storage(path, e))?;
    // SAFETY: files of a workspace are written once under another name and renamed; a mapping never sees a write.
    unsafe { Mmap::map(&file) }.map_err(|e| Error::storage(path, e))
}

/// Lets go of the memory that a mapping took up to now; what is looked at again comes back from the file. A failure changes nothing but memory.
pub fn release(map: &Mmap) {
    // SAFETY: the mapping is of a file and read-only, so what is dropped is read again as it was.
    let _ = unsafe { map.unchecked_advise(memmap2::UncheckedAdvice::DontNeed) };
}

/// Checks magic, version and, on demand, the checksum over everything after `HEADER_BYTES`.
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

fn compare(path: &Path, bytes: &[u8], actual: u64) -> Result<()> {
    let stored = u64::from_le_bytes(bytes[8..16].try_into().expect("8 bytes"));
    match stored == actual {
        true => Ok(()),
        false => Err(Error::format(path, format!("checksum {actual:016x}, expected {stored:016x}: the file is damaged"))),
    }
}

/// `count` records of `T` at `offset`, or an error that says the file is too short. `offset` must be aligned for `T`.
pub fn section<'a, T: Pod>(path: &Path, bytes: &'a [u8], offset: usize, count: usize) -> Result<&'a [T]> {
    let end = count.checked_mul(size_of::<T>()).and_then(|n| offset.checked_add(n));
    let slice = end.and_then(|end| bytes.get(offset..end));
    let slice = slice.ok_or_else(|| Error::format(path, format!("truncated: {count} records at byte {offset} of {}", bytes.len())))?;
    bytemuck::try_cast_slice(slice).map_err(|e| Error::format(path, format!("misaligned section at byte {offset}: {e}")))
}
