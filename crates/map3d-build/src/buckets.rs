//! Sorts triangles into cells in bounded memory; what exceeds it is appended to one file per cell.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};

use map3d_base::{Error, Result};
use map3d_scene::index::Cell;

use crate::triangle::BuildTriangle;

const READ_BYTES: usize = 1 << 20;

pub(crate) struct TriangleBuckets {
    folder: PathBuf,
    memory: BTreeMap<Cell, Vec<BuildTriangle>>,
    held: usize,
    /// Most triangles in memory.
    limit: usize,
}

impl TriangleBuckets {
    /// Writes files to `folder` and empties it first.
    pub fn new(folder: &Path, memory_bytes: u64) -> Result<Self> {
        remove_folder(folder)?;
        let limit = (memory_bytes as usize / size_of::<BuildTriangle>()).max(1);
        Ok(Self { folder: folder.to_path_buf(), memory: BTreeMap::new(), held: 0, limit })
    }

    pub fn push(&mut self, cell: Cell, triangle: &BuildTriangle) -> Result<()> {
        self.memory.entry(cell).or_default().push(*triangle);
        self.held += 1;
        if self.held > self.limit { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<()> {
        fs::create_dir_all(&self.folder).map_err(|e| Error::storage(&self.folder, e))?;
        for (cell, triangles) in std::mem::take(&mut self.memory) {
            let path = self.path(cell);
            let file = File::options().create(true).append(true).open(&path);
            file.and_then(|mut f| f.write_all(bytemuck::cast_slice(&triangles))).map_err(|e| Error::storage(&path, e))?;
        }
        self.held = 0;
        Ok(())
    }

    fn path(&self, [level, x, y]: Cell) -> PathBuf {
        self.folder.join(format!("{level}_{x}_{y}.spill"))
    }

    /// Removes the file of a cell.
    pub fn remove(&self, cell: Cell) -> Result<()> {
        let path = self.path(cell);
        match fs::remove_file(&path) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::storage(&path, e)),
            _ => Ok(()),
        }
    }

    /// Returns all triangles of a cell in the order in which they were pushed.
    pub fn load(&self, cell: Cell) -> Result<Vec<BuildTriangle>> {
        let mut out = Vec::new();
        self.stream(cell, &mut |t| {
            out.push(*t);
            Ok(())
        })?;
        Ok(out)
    }

    /// Passes on all triangles of a cell in the order in which they were pushed, in bounded memory.
    pub fn stream(&self, cell: Cell, out: &mut dyn FnMut(&BuildTriangle) -> Result<()>) -> Result<()> {
        let path = self.path(cell);
        if path.exists() {
            let io = |e| Error::storage(&path, e);
            let mut file = BufReader::with_capacity(READ_BYTES, File::open(&path).map_err(io)?);
            let mut bytes = [0; size_of::<BuildTriangle>()];
            while !file.fill_buf().map_err(io)?.is_empty() {
                file.read_exact(&mut bytes).map_err(io)?;
                out(&bytemuck::pod_read_unaligned(&bytes))?;
            }
        }
        self.memory.get(&cell).map_or(&[][..], Vec::as_slice).iter().try_for_each(out)
    }
}

impl Drop for TriangleBuckets {
    fn drop(&mut self) {
        // The next build removes what remains here.
        let _ = fs::remove_dir_all(&self.folder);
    }
}

fn remove_folder(folder: &Path) -> Result<()> {
    match fs::remove_dir_all(folder) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::storage(folder, e)),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    #[test]
    fn removing_a_cell_keeps_the_others() {
        let folder = std::env::temp_dir().join(format!("map3d-spill-{}", std::process::id()));
        let mut buckets = TriangleBuckets::new(&folder, 1).expect("a folder");
        let triangle = |x| BuildTriangle { corners: [[x, 0, 0], [x, 1, 0], [x, 0, 1]], ..BuildTriangle::zeroed() };
        let cells = [[1, 0, 0], [1, 1, 0]];
        for k in 0..6 {
            buckets.push(cells[k % 2], &triangle(k as i64)).expect("written");
        }
        let first = |buckets: &TriangleBuckets, cell| buckets.load(cell).expect("read").iter().map(|t| t.corners[0][0]).collect::<Vec<_>>();
        assert_eq!((first(&buckets, cells[0]), first(&buckets, cells[1])), (vec![0, 2, 4], vec![1, 3, 5]));
        buckets.remove(cells[0]).expect("removed");
        buckets.remove(cells[0]).expect("nothing to remove");
        assert_eq!((first(&buckets, cells[0]), first(&buckets, cells[1])), (vec![], vec![1, 3, 5]));
        drop(buckets);
        assert!(!folder.exists());
    }
}
