//! Chunk files that are there already, by the hash of what went into them: what would come out the same is not built again.

use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use bytemuck::Zeroable;
use map3d_base::{Error, Result};

use crate::chunk::Sections;
use crate::index::{Cell, ChunkEntry};
use crate::records::{CHUNK_MAGIC, ChunkHeader, VERSION};

pub(super) const CHUNKS: &str = "chunks";

pub(super) struct Shelf(HashMap<[u64; 2], Vec<OnShelf>>);

#[derive(Clone)]
pub(super) struct OnShelf {
    pub entry: ChunkEntry,
    pub header: ChunkHeader,
}

impl Shelf {
    /// Looks at the heads of all chunks of cells in a scene's folder.
    pub fn look(folder: &Path) -> Result<Self> {
        let mut out = Self(HashMap::new());
        let chunks = folder.join(CHUNKS);
        let Ok(entries) = std::fs::read_dir(&chunks) else { return Ok(out) };
        for entry in entries {
            let name = entry.map_err(|e| Error::storage(&chunks, e))?.file_name();
            let Some((name, cell)) = name.to_str().and_then(|n| Some((n, cell_of(n)?))) else { continue };
            if let Some(found) = on_shelf(folder, &format!("{CHUNKS}/{name}"), Some(cell)) {
                out.0.entry(found.header.input).or_default().push(found);
            }
        }
        Ok(out)
    }

    /// The chunks of a sorting cell that were made of this input, if they are all there.
    pub fn find(&self, cell: Cell, input: [u64; 2]) -> Option<Vec<OnShelf>> {
        let mine: Vec<OnShelf> = self.0.get(&input)?.iter().filter(|f| f.entry.cell.is_some_and(|c| is_within(c, cell))).cloned().collect();
        mine.iter().all(|f| f.header.parts as usize == mine.len()).then_some(mine)
    }
}

/// A chunk as the scene index names it, read from its head; `None` unless it is one of this version, as long as it should be.
pub(super) fn on_shelf(folder: &Path, name: &str, cell: Option<Cell>) -> Option<OnShelf> {
    let mut file = File::open(folder.join(name)).ok()?;
    let bytes = file.metadata().ok()?.len();
    let mut header = ChunkHeader::zeroed();
    file.read_exact(bytemuck::bytes_of_mut(&mut header)).ok()?;
    let sound = header.magic == *CHUNK_MAGIC && header.version == VERSION && Sections::of(&header).end as u64 == bytes;
    let entry = ChunkEntry {
        file: name.to_owned(),
        cell,
        origin: header.origin,
        bounds: header.placed_bounds(),
        triangles: u64::from(header.triangles),
        bytes,
        hash: format!("{:016x}", header.checksum),
    };
    sound.then_some(OnShelf { entry, header })
}

/// `<level>_<x>_<y>.m3c`, `<level>_<x>_<y>_<slab>.m3c`.
fn cell_of(name: &str) -> Option<Cell> {
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
    fn names_tell_cells_and_only_cells() {
        assert_eq!(cell_of("3_1_2.m3c"), Some([3, 1, 2]));
        assert_eq!(cell_of("3_1_2_-4.m3c"), Some([3, 1, 2]));
        for other in ["p_00ff.m3c", "3_1.m3c", "3_1_2.part", "3_1_x.m3c", ""] {
            assert_eq!(cell_of(other), None, "{other}");
        }
    }

    #[test]
    fn a_cell_lies_within_itself_and_those_above() {
        assert!(is_within([3, 5, 6], [3, 5, 6]) && is_within([3, 5, 6], [1, 1, 1]) && is_within([3, 5, 6], [0, 0, 0]));
        assert!(!is_within([3, 5, 6], [1, 0, 1]) && !is_within([1, 1, 1], [3, 5, 6]));
    }
}
