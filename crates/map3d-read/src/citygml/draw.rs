//! Polygons of the arena to triangles of a batch.

use map3d_base::asset::{Batch, Rank};
use map3d_base::{Error, Result, Vec3};

use super::appearance::Appearances;
use super::geometry::{Geometry, NO_NODE, NodeId, Ring, Shape};
use super::ids::{self, Id};
use super::paint::{Paint, Painter, RingPoints};
use crate::materials::shifted_uvs;
use crate::report::Log;
use crate::triangulate::Triangulator;

/// A polygon to draw; `flip`: its other side is its front.
#[derive(Clone, Copy, Debug)]
pub struct Leaf {
    pub node: NodeId,
    pub flip: bool,
}

/// Whose polygons are drawn.
pub struct Surface<'a> {
    pub object: u32,
    pub rank: Rank,
    /// Element names of the surface and of its object.
    pub locals: [&'a str; 2],
    /// Ids of the features from the surface upwards.
    pub feature_ids: &'a [Id],
    pub name: &'a str,
}

/// References between nodes of one arena: (referred to, group that refers), sorted.
pub type Aliases = Vec<(NodeId, NodeId)>;

/// An arena and the references in it.
#[derive(Clone, Copy)]
pub struct Tree<'a> {
    pub geometry: &'a Geometry,
    pub aliases: &'a Aliases,
}

pub fn aliases(geometry: &Geometry) -> Aliases {
    let links = geometry.nodes.iter().filter_map(|node| match node.shape {
        Shape::Link(id) if node.parent != NO_NODE => Some((*geometry.by_id.get(&id)?, node.parent)),
        _ => None,
    });
    let mut aliases: Aliases = links.collect();
    aliases.sort_unstable();
    aliases
}

/// Turns polygons into triangles; buffers are reused.
pub struct Drawer {
    triangulator: Triangulator,
    pub batch: Batch,
    any_uvs: bool,
    max_ring_vertices: u64,
    max_triangles: u64,
    triangles: u64,
    points: Vec<Vec3>,
    uvs: Vec<[f64; 2]>,
    raw_uvs: Vec<[f64; 2]>,
    ends: Vec<usize>,
    chain: Vec<Id>,
}

/// What a polygon is painted with.
pub struct Paints<'a> {
    pub painter: &'a mut Painter,
    pub stores: [&'a mut Appearances; 2],
}

impl Drawer {
    /// `scale`: metres per unit of each axis.
    pub fn new(scale: Vec3, max_ring_vertices: u64, max_triangles: u64) -> Self {
        Self {
            triangulator: Triangulator::new(scale),
            batch: Batch::default(),
            any_uvs: false,
            max_ring_vertices,
            max_triangles,
            triangles: 0,
            points: Vec::new(),
            uvs: Vec::new(),
            raw_uvs: Vec::new(),
            ends: Vec::new(),
            chain: Vec::new(),
        }
    }

    /// The batch so far; begins a new one.
    pub fn take(&mut self) -> Batch {
        let mut batch = std::mem::take(&mut self.batch);
        if !std::mem::take(&mut self.any_uvs) {
            batch.uvs.clear();
        }
        batch.uvs_shifted = true;
        batch
    }

    pub fn polygon(&mut self, tree: Tree, leaf: Leaf, surface: &Surface, paints: &mut Paints, log: &mut Log) -> Result<()> {
        let points = |r: &Ring| RingPoints { id: r.id, points: &tree.geometry.points[r.start as usize..r.end as usize] };
        let rings: Vec<RingPoints> = tree.geometry.rings_of(tree.geometry.node(leaf.node).shape).iter().map(points).collect();
        let Some(paint) = self.paint(tree, leaf.node, &rings, surface, paints, log)? else { return Ok(()) };
        if !self.assemble(&rings, paint.textured, surface, log)? {
            return Ok(());
        }
        match self.triangulator.polygon(&self.points, &self.ends) {
            Err(fault) => return log.skip(fault.reason(), || surface.name.to_owned()),
            Ok(false) => log.warn("polygon whose rings cross", surface.name)?,
            Ok(true) => {}
        }
        self.push(leaf.flip, surface, paint, log)
    }

    /// `None`: not drawn, and counted.
    fn paint(
        &mut self,
        tree: Tree,
        node: NodeId,
        rings: &[RingPoints],
        surface: &Surface,
        paints: &mut Paints,
        log: &mut Log,
    ) -> Result<Option<Paint>> {
        let mut found = None;
        if paints.stores.iter().any(|s| !s.is_empty()) {
            self.chain.clear();
            climb(tree, node, &mut self.chain);
            self.chain.extend(surface.feature_ids.iter().filter(|id| **id != ids::NONE));
            let [a, b] = &mut paints.stores;
            found = paints.painter.paint(&self.chain, rings, &mut [a, b], &mut self.raw_uvs, log)?;
        }
        let paint = found.unwrap_or_else(|| paints.painter.default_paint(surface.locals));
        if paint.invisible {
            log.report.skip("fully transparent polygon", 1);
            return Ok(None);
        }
        Ok(Some(paint))
    }

    /// Opens the rings and drops points that repeat the one before. False: nothing is left to draw.
    fn assemble(&mut self, rings: &[RingPoints], textured: bool, surface: &Surface, log: &mut Log) -> Result<bool> {
        self.points.clear();
        self.uvs.clear();
        self.ends.clear();
        let mut raw = 0;
        for (k, ring) in rings.iter().enumerate() {
            let uvs = textured.then(|| &self.raw_uvs[raw..raw + ring.points.len()]);
            raw += ring.points.len();
            let start = self.points.len();
            append_ring(ring.points, uvs, &mut self.points, &mut self.uvs);
            let limit = self.max_ring_vertices;
            let fault = match self.points.len() - start {
                0..3 => "ring with fewer than 3 points".to_owned(),
                n if n as u64 > limit => format!("ring over the limit max_ring_vertices = {limit}"),
                _ => {
                    self.ends.push(self.points.len());
                    if ring.points.first() != ring.points.last() {
                        log.warn("ring that is not closed", surface.name)?;
                    }
                    continue;
                }
            };
            log.skip(&fault, || surface.name.to_owned())?;
            self.points.truncate(start);
            self.uvs.truncate(if textured { start } else { 0 });
            if k == 0 {
                return Ok(false);
            }
        }
        if rings.is_empty() {
            log.skip("polygon without rings", || surface.name.to_owned())?;
        }
        Ok(!rings.is_empty())
    }

    fn push(&mut self, flip: bool, surface: &Surface, paint: Paint, log: &Log) -> Result<()> {
        let batch = &mut self.batch;
        let base = batch.positions.len() as u32;
        batch.positions.extend_from_slice(&self.points);
        self.any_uvs |= paint.textured;
        let triangles = self.triangulator.triangles().as_chunks::<3>().0;
        for t in triangles {
            let [a, b, c] = *t;
            let t = if flip { [a, c, b] } else { [a, b, c] };
            batch.triangles.push(t.map(|i| base + i));
            let uvs = if paint.textured { shifted_uvs(t.map(|i| self.uvs[i as usize]), paint.wrap) } else { Default::default() };
            batch.uvs.push(uvs);
            batch.materials.push(paint.material);
            batch.objects.push(surface.object);
            batch.ranks.push(surface.rank);
        }
        self.triangles += triangles.len() as u64;
        let (got, value) = (self.triangles, self.max_triangles);
        if got > value {
            return Err(Error::Limit { path: log.path().to_path_buf(), what: "number of triangles", got, limit: "max_triangles", value });
        }
        Ok(())
    }
}

/// Ids from a node upwards, then those of groups that refer to it or to what it is in.
fn climb(Tree { geometry, aliases }: Tree, node: NodeId, chain: &mut Vec<Id>) {
    const MAX_ALIASES: usize = 8;
    let upwards = |from: NodeId| {
        let up = move |n: &NodeId| Some(geometry.node(*n).parent).filter(|p| *p != NO_NODE);
        std::iter::successors(Some(from), up)
    };
    let ids_above = |from: NodeId| upwards(from).map(|n| geometry.node(n).id).filter(|id| *id != ids::NONE);
    chain.extend(ids_above(node));
    if aliases.is_empty() {
        return;
    }
    for ancestor in upwards(node) {
        let first = aliases.partition_point(|a| a.0 < ancestor);
        for (_, group) in aliases[first..].iter().take_while(|a| a.0 == ancestor).take(MAX_ALIASES) {
            chain.extend(ids_above(*group));
        }
    }
}

fn append_ring(points: &[Vec3], uvs: Option<&[[f64; 2]]>, out: &mut Vec<Vec3>, uvs_out: &mut Vec<[f64; 2]>) {
    let start = out.len();
    for (k, point) in points.iter().enumerate() {
        if out.len() > start && out.last() == Some(point) {
            continue;
        }
        out.push(*point);
        uvs_out.extend(uvs.map(|uvs| uvs[k]));
    }
    while out.len() > start + 1 && out.last() == out.get(start) {
        out.pop();
        uvs_out.truncate(uvs_out.len().saturating_sub(usize::from(uvs.is_some())));
    }
}

/// Gathers the polygons below nodes, each once, in the order of the document.
pub struct Gatherer<'a> {
    pub geometry: &'a Geometry,
    /// Per node: 0 not seen, 1 on the way down to here, 2 done.
    pub seen: &'a mut Vec<u8>,
    pub leaves: Vec<Leaf>,
    /// References to what is not in this arena.
    pub outside: Vec<(Id, bool)>,
    pub cycles: u64,
}

const MAX_HOPS: usize = 1024;

impl Gatherer<'_> {
    pub fn gather(&mut self, number: NodeId, flip: bool, hops: usize) {
        let seen = self.seen[number as usize];
        if seen == 1 || hops > MAX_HOPS {
            self.cycles += 1;
        }
        if seen != 0 || hops > MAX_HOPS {
            return;
        }
        let node = *self.geometry.node(number);
        let flip = flip != node.flip;
        self.seen[number as usize] = 1;
        match node.shape {
            Shape::Polygon { .. } => self.leaves.push(Leaf { node: number, flip }),
            Shape::Link(id) => match self.geometry.by_id.get(&id) {
                Some(target) => self.gather(*target, flip, hops + 1),
                None => self.outside.push((id, flip)),
            },
            Shape::Group => {
                let mut child = node.first_child;
                while child != NO_NODE {
                    self.gather(child, flip, hops + 1);
                    child = self.geometry.node(child).next;
                }
            }
        }
        self.seen[number as usize] = 2;
    }
}
