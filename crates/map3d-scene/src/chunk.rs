//! Memory-mapped chunk files.

use std::path::{Path, PathBuf};

use map3d_base::file::{self, aligned};
use map3d_base::{Box3, Error, Result, Vec3};
use memmap2::Mmap;

use crate::records::{
    CHUNK_MAGIC, ChunkHeader, ChunkObject, CornerNormals, EMPTY, FLAG_CUTOUT, FLAG_NORMALS, LEAF_BIT, Leaf, MaterialRecord, Node, TriangleRecord,
    VERSION,
};

/// Section offsets in bytes.
#[derive(Clone, Copy, Debug)]
pub struct Sections {
    pub nodes: usize,
    pub leaves: usize,
    pub triangles: usize,
    pub normals: usize,
    pub materials: usize,
    pub objects: usize,
    pub end: usize,
}

impl Sections {
    pub fn of_header(header: &ChunkHeader) -> Self {
        let nodes = size_of::<ChunkHeader>();
        let leaves = nodes + header.nodes as usize * size_of::<Node>();
        let triangles = leaves + header.leaves as usize * size_of::<Leaf>();
        let normals = triangles + aligned(header.triangles as usize * size_of::<TriangleRecord>());
        let normal_count = if header.flags & FLAG_NORMALS != 0 { header.triangles as usize } else { 0 };
        let materials = normals + aligned(normal_count * size_of::<CornerNormals>());
        let objects = materials + header.materials as usize * size_of::<MaterialRecord>();
        let end = objects + header.objects as usize * size_of::<ChunkObject>();
        Self { nodes, leaves, triangles, normals, materials, objects, end }
    }
}

/// A mapped chunk. Positions are float32 relative to `origin`; `origin` + position is exact in float64.
#[derive(Debug)]
pub struct Chunk {
    path: PathBuf,
    map: Mmap,
    header: ChunkHeader,
    sections: Sections,
}

impl Chunk {
    /// Maps and validates a chunk. `with_checksum` also compares the checksum of every byte.
    pub fn open(path: &Path, with_checksum: bool) -> Result<Self> {
        let chunk = Self::map(path, with_checksum)?;
        chunk.validate()?;
        Ok(chunk)
    }

    /// Maps a chunk that this process has validated before; the caller compares checksums.
    pub(crate) fn open_trusted(path: &Path) -> Result<Self> {
        Self::map(path, false)
    }

    /// Maps a chunk of which the caller reads only a few pages.
    pub(crate) fn open_lazily(path: &Path) -> Result<LazyChunk> {
        let chunk = Self::map(path, false)?;
        chunk.validate_objects()?;
        Ok(LazyChunk(chunk))
    }

    fn map(path: &Path, with_checksum: bool) -> Result<Self> {
        let map = file::map(path)?;
        file::check_header(path, &map, CHUNK_MAGIC, VERSION, with_checksum)?;
        let header = *file::section::<ChunkHeader>(path, &map, 0, 1)?.first().ok_or_else(|| Error::format(path, "no header"))?;
        let sections = Sections::of_header(&header);
        if sections.end != map.len() {
            return Err(Error::format(path, format!("{} bytes, expected {}", map.len(), sections.end)));
        }
        Ok(Self { path: path.to_path_buf(), map, header, sections })
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Size of the mapping.
    pub fn bytes(&self) -> usize {
        self.map.len()
    }

    pub fn origin(&self) -> Vec3 {
        self.header.origin
    }

    /// Box of all triangles in the frame of `origin` (local; a prototype's: its own frame).
    pub fn bounds(&self) -> Box3 {
        let b = self.header.bounds.map(f64::from);
        let o = self.header.origin;
        Box3 { lo: [o[0] + b[0], o[1] + b[1], o[2] + b[2]], hi: [o[0] + b[3], o[1] + b[4], o[2] + b[5]] }
    }

    pub fn checksum(&self) -> u64 {
        self.header.checksum
    }

    pub fn has_cutouts(&self) -> bool {
        self.header.flags & FLAG_CUTOUT != 0
    }

    fn section<T: bytemuck::Pod>(&self, offset: usize, count: u32) -> &[T] {
        bytemuck::cast_slice(&self.map[offset..offset + count as usize * size_of::<T>()])
    }

    /// Node 0 is the root.
    pub fn nodes(&self) -> &[Node] {
        self.section(self.sections.nodes, self.header.nodes)
    }

    pub fn leaves(&self) -> &[Leaf] {
        self.section(self.sections.leaves, self.header.leaves)
    }

    pub fn triangles(&self) -> &[TriangleRecord] {
        self.section(self.sections.triangles, self.header.triangles)
    }

    /// Empty when no triangle of the chunk has shading normals.
    pub fn normals(&self) -> &[CornerNormals] {
        let has = self.header.flags & FLAG_NORMALS != 0;
        self.section(self.sections.normals, if has { self.header.triangles } else { 0 })
    }

    pub fn materials(&self) -> &[MaterialRecord] {
        self.section(self.sections.materials, self.header.materials)
    }

    pub fn objects(&self) -> &[ChunkObject] {
        self.section(self.sections.objects, self.header.objects)
    }

    /// Validates every index, number and box.
    pub fn validate(&self) -> Result<()> {
        let fail = |what: String| Err(Error::format(&self.path, what));
        let h = &self.header;
        if h.nodes == 0 || h.leaves == 0 || h.triangles == 0 {
            return fail("a chunk holds at least one triangle".into());
        }
        if !h.origin.iter().all(|v| v.is_finite()) || !h.bounds.iter().all(|v| v.is_finite()) {
            return fail("origin or box is not finite".into());
        }
        self.validate_triangles()?;
        self.validate_tree()
    }

    fn validate_triangles(&self) -> Result<()> {
        for (i, t) in self.triangles().iter().enumerate() {
            let sound = t.material < self.header.materials && t.object < self.header.objects && t.uv.as_flattened().iter().all(|v| v.is_finite());
            if !sound {
                return Err(Error::format(&self.path, format!("triangle {i}: material, object or uv out of range")));
            }
        }
        self.validate_objects()
    }

    fn validate_objects(&self) -> Result<()> {
        match self.objects().iter().position(|o| o.id == 0 || !o.bounds.iter().all(|v| v.is_finite())) {
            Some(i) => Err(Error::format(&self.path, format!("object {i}: id 0 or a box that is not finite"))),
            None => Ok(()),
        }
    }

    /// Checks that each node and leaf is reached exactly once, that boxes contain their children and that each triangle is in one leaf.
    fn validate_tree(&self) -> Result<()> {
        let (nodes, leaves) = (self.nodes(), self.leaves());
        let (mut seen_node, mut seen_leaf) = (vec![false; nodes.len()], vec![false; leaves.len()]);
        let mut seen_triangle = vec![false; self.header.triangles as usize];
        let mut stack = vec![(0u32, self.header.bounds)];
        while let Some((child, bounds)) = stack.pop() {
            let fail = |what: &str| Err(Error::format(&self.path, format!("child {child:#x}: {what}")));
            if child & LEAF_BIT != 0 {
                let number = (child & !LEAF_BIT) as usize;
                if number >= leaves.len() || std::mem::replace(&mut seen_leaf[number], true) {
                    return fail("leaf out of range or reached twice");
                }
                if !leaf_is_sound(&leaves[number], &bounds, &mut seen_triangle) {
                    return fail("leaf with a corner outside its box or a bad triangle number");
                }
                continue;
            }
            if child as usize >= nodes.len() || std::mem::replace(&mut seen_node[child as usize], true) {
                return fail("node out of range or reached twice");
            }
            let node = &nodes[child as usize];
            for k in (0..8).filter(|k| node.child[*k] != EMPTY) {
                let inner = [0, 1, 2, 3, 4, 5].map(|a| node.bounds[a][k]);
                if !(0..3).all(|a| inner[a] >= bounds[a] && inner[a + 3] <= bounds[a + 3] && inner[a] <= inner[a + 3]) {
                    return fail("a child's box sticks out of its parent's");
                }
                stack.push((node.child[k], inner));
            }
        }
        if seen_node.iter().chain(&seen_leaf).chain(&seen_triangle).all(|s| *s) {
            return Ok(());
        }
        Err(Error::format(&self.path, "a node, leaf or triangle is not reached from the root"))
    }
}

/// A mapped chunk whose nodes and leaves are validated when they are read; the rest is not read.
#[derive(Debug)]
pub struct LazyChunk(Chunk);

impl LazyChunk {
    pub fn origin(&self) -> Vec3 {
        self.0.header.origin
    }

    pub fn checksum(&self) -> u64 {
        self.0.header.checksum
    }

    pub fn objects(&self) -> &[ChunkObject] {
        self.0.objects()
    }

    /// Returns a node after a check that its children follow it, so that a traversal ends.
    pub fn node(&self, number: u32) -> Result<&Node> {
        let node = self.0.nodes().get(number as usize).ok_or_else(|| self.fail("node", number))?;
        match node.child.iter().all(|c| *c == EMPTY || c & LEAF_BIT != 0 || *c > number) {
            true => Ok(node),
            false => Err(self.fail("child of node", number)),
        }
    }

    pub fn leaf(&self, number: u32) -> Result<&Leaf> {
        self.0.leaves().get(number as usize).ok_or_else(|| self.fail("leaf", number))
    }

    fn fail(&self, what: &str, number: u32) -> Error {
        Error::format(&self.0.path, format!("{what} {number}: out of range"))
    }
}

fn leaf_is_sound(leaf: &Leaf, bounds: &[f32; 6], seen: &mut [bool]) -> bool {
    let count = leaf.triangle.iter().take_while(|t| **t != EMPTY).count();
    if count == 0 || leaf.triangle[count..].iter().any(|t| *t != EMPTY) {
        return false;
    }
    (0..count).all(|k| {
        let number = leaf.triangle[k] as usize;
        let fresh = number < seen.len() && !std::mem::replace(&mut seen[number], true);
        fresh && (0..9).all(|c| leaf.corners[c][k] >= bounds[c % 3] && leaf.corners[c][k] <= bounds[c % 3 + 3])
    })
}
