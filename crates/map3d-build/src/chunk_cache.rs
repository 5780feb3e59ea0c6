//! Chunk files of earlier builds, by the hash of their input: a build reuses those whose input is the same.

use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use bytemuck::Zeroable;
use map3d_base::{Error, Result};
use map3d_scene::chunk::Sections;
use map3d_scene::index::{Cell, ChunkEntry};
use map3d_scene::records::{CHUNK_MAGIC, ChunkHeader, VERSION};

pub(crate) const CHUNKS: &str = "chunks";

pub(crate) struct ChunkCache(HashMap<[u64; 2], Vec<CachedChunk>>);

#[derive(Clone)]
pub(crate) struct CachedChunk {
    pub entry: ChunkEntry,
    pub header: ChunkHeader,
}

impl ChunkCache {
    /// Reads the headers of all chunks of cells in a scene's folder.
    pub fn scan(folder: &Path) -> Result<Self> {
        let mut out = Self(HashMap::new());
        let chunks = folder.join(CHUNKS);
        let Ok(entries) = std::fs::read_dir(&chunks) else { return Ok(out) };
        for entry in entries {
            let name = entry.map_err(|e| Error::storage(&chunks, e))?.file_name();
            let Some((name, cell)) = name.to_str().and_then(|n| Some((n, parse_cell(n)?))) else { continue };
            if let Some(found) = read_cached_chunk(folder, &format!("{CHUNKS}/{name}"), Some(cell)) {
                out.0.entry(found.header.input).or_default().push(found);
            }
        }
        Ok(out)
    }

    /// Returns the chunks of a sorting cell that were built from an input, if all of them exist.
    pub fn find(&self, cell: Cell, input: [u64; 2]) -> Option<Vec<CachedChunk>> {
        let chunks: Vec<CachedChunk> = self.0.get(&input)?.iter().filter(|f| f.entry.cell.is_some_and(|c| is_within(c, cell))).cloned().collect();
        chunks.iter().all(|f| f.header.parts as usize == chunks.len()).then_some(chunks)
    }
}

/// Reads the header of a chunk; `None` unless version and length are right.
pub(crate) fn read_cached_chunk(folder: &Path, name: &str, cell: Option<Cell>) -> Option<CachedChunk> {
    let mut file = File::open(folder.join(name)).ok()?;
    let bytes = file.metadata().ok()?.len();
    let mut header = ChunkHeader::zeroed();
    file.read_exact(bytemuck::bytes_of_mut(&mut header)).ok()?;
    let sound = header.magic == *CHUNK_MAGIC && header.version == VERSION && Sections::of_header(&header).end as u64 == bytes;
    let entry = ChunkEntry {
        file: name.to_owned(),
        cell,
        origin: header.origin,
        bounds: header.placed_bounds(),
        triangles: u64::from(header.triangles),
        bytes,
        hash: format!("{:016x}", header.checksum),
    };
    sound.then_some(CachedChunk { entry, header })
}

/// Parses `<level>_<x>_<y>.m3c` and `<level>_<x>_<y>_<slab>.m3c`.
fn parse_cell(name: &str) -> Option<Cell> {
    let mut numbers = name.strip_suffix(".m3c")?.splitn(4, '_');
    let mut next = || numbers.next()?.parse::<u32>().ok();
    Some([next()?, next()?, next()?])
}

fn is_within(inner: Cell, outer: Cell) -> bool {
    let up = inner[0].checked_sub(outer[0]).filter(|up| *up < 32);
    up.is_some_and(|up| [inner[1] >> up, inner[2] >> up] == [outer[1], outer[2]])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_names_of_cells_are_parsed() {
        assert_eq!(parse_cell("3_1_2.m3c"), Some([3, 1, 2]));
        assert_eq!(parse_cell("3_1_2_-4.m3c"), Some([3, 1, 2]));
        for other in ["p_00ff.m3c", "3_1.m3c", "3_1_2.part", "3_1_x.m3c", ""] {
            assert_eq!(parse_cell(other), None, "{other}");
        }
    }

    #[test]
    fn a_cell_is_within_itself_and_its_ancestors() {
        assert!(is_within([3, 5, 6], [3, 5, 6]) && is_within([3, 5, 6], [1, 1, 1]) && is_within([3, 5, 6], [0, 0, 0]));
        assert!(!is_within([3, 5, 6], [1, 0, 1]) && !is_within([1, 1, 1], [3, 5, 6]));
    }
}
