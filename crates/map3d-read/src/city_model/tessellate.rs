//! Tessellates polygons of the arena into the triangles of a batch.

use map3d_base::asset::{Batch, Rank};
use map3d_base::reason::Message;
use map3d_base::{Reason, Result, Vec3};

use super::appearance::{Appearances, ResolvedMaterial};
use super::crs_table::{CrsNumber, DOCUMENT_CRS, HorizontalKey, estimate_metres_per_unit, horizontal_key};
use super::geometry_arena::NodeId;
use super::ids::{self, Id};
use super::material_resolver::{MaterialResolver, RingPoints};
use super::polygons::{LinkedGeometry, OrientedPolygon};
use crate::document::material_table::shift_uvs;
use crate::document::options::ReadOptions;
use crate::document::report_builder::{LimitCheck, ReportBuilder};
use crate::triangulation::triangulate::{Coverage, Triangulator};

/// The feature that polygons belong to.
pub struct ThematicSurface<'a> {
    /// Index of the city object in the asset.
    pub object: u32,
    pub rank: Rank,
    /// Element names of the surface and of its object.
    pub type_names: [&'a str; 2],
    /// Ids of the feature and its ancestors, from the feature up.
    pub feature_ids: &'a [Id],
    /// Name of the city object, for the report.
    pub object_name: &'a str,
}

/// The resolver and the appearances that may target the polygons: those of the city object, then those of the document.
pub struct MaterialSources<'a> {
    pub resolver: &'a mut MaterialResolver,
    pub appearances: [&'a mut Appearances; 2],
}

/// A batch that grows.
struct OpenBatch {
    batch: Batch,
    has_uvs: bool,
}

impl OpenBatch {
    fn finish(mut self) -> Batch {
        if !self.has_uvs {
            self.batch.uvs.clear();
        }
        self.batch.uvs_shifted = true;
        self.batch
    }
}

/// Collects triangles in batches, one for each coordinate system. Buffers are reused from polygon to polygon.
pub struct Tessellator {
    triangulator: Triangulator,
    open: Vec<OpenBatch>,
    /// Metres per unit of the axes of each coordinate system.
    scales: Vec<Vec3>,
    /// Key of each coordinate system that has a name.
    keys: Vec<Option<HorizontalKey>>,
    /// Polygons are those of a prototype, in a frame of its own in metres.
    is_prototype: bool,
    options: ReadOptions,
    /// Number of triangles of the whole document.
    triangles: u64,
    /// Per object: whether polygons with and without heights were drawn.
    has_heights: Vec<[bool; 2]>,
    points: Vec<Vec3>,
    uvs: Vec<[f64; 2]>,
    /// Texture coordinates of the rings as written, before repeated points are dropped.
    source_uvs: Vec<[f64; 2]>,
    ring_ends: Vec<usize>,
    target_ids: Vec<Id>,
}

impl Tessellator {
    pub fn new(options: ReadOptions) -> Self {
        Self {
            triangulator: Triangulator::default(),
            open: Vec::new(),
            scales: Vec::new(),
            keys: Vec::new(),
            is_prototype: false,
            options,
            triangles: 0,
            has_heights: Vec::new(),
            points: Vec::new(),
            uvs: Vec::new(),
            source_uvs: Vec::new(),
            ring_ends: Vec::new(),
            target_ids: Vec::new(),
        }
    }

    /// Adds the coordinate systems that are new.
    pub fn set_coordinate_systems(&mut self, names: &[Option<String>]) {
        let added = names.iter().skip(self.scales.len()).map(|name| estimate_metres_per_unit(name.as_deref()));
        self.scales.extend(added);
        let added = names.iter().skip(self.keys.len()).map(|name| name.as_deref().map(horizontal_key));
        self.keys.extend(added);
    }

    /// Returns the batches with at least `min_triangles`, and at least one. Others keep growing.
    pub fn take(&mut self, min_triangles: usize) -> Vec<Batch> {
        let is_complete = |open: &OpenBatch| open.batch.triangles.len() >= min_triangles.max(1);
        self.open.extract_if(.., |open| is_complete(open)).map(OpenBatch::finish).collect()
    }

    /// Begins a prototype. All batches before it must be taken.
    pub fn begin_prototype(&mut self) {
        self.is_prototype = true;
    }

    /// Returns the batch of the prototype.
    pub fn take_prototype(&mut self) -> Batch {
        self.is_prototype = false;
        self.open.pop().map(OpenBatch::finish).unwrap_or_default()
    }

    /// Returns the objects whose polygons all have no heights.
    pub fn objects_without_height(&self) -> impl Iterator<Item = usize> + '_ {
        self.has_heights.iter().enumerate().filter(|(_, has)| **has == [false, true]).map(|(object, _)| object)
    }

    fn note_heights(&mut self, object: u32, is_flat: bool) {
        let object = object as usize;
        if self.has_heights.len() <= object {
            self.has_heights.resize(object + 1, [false; 2]);
        }
        self.has_heights[object][usize::from(is_flat)] = true;
    }

    /// Tessellates a polygon, or skips and counts it.
    pub fn add_polygon(
        &mut self,
        geometry: LinkedGeometry,
        polygon: OrientedPolygon,
        surface: &ThematicSurface,
        sources: &mut MaterialSources,
        report: &mut ReportBuilder,
    ) -> Result<()> {
        let arena = geometry.geometry;
        let rings = arena.polygon_rings(arena.node(polygon.node).kind).iter();
        let key = self.keys.get(arena.node(polygon.node).crs as usize).copied().flatten().filter(|_| !self.is_prototype);
        let polygon_id = arena.node(polygon.node).id;
        let rings: Vec<RingPoints> = rings.map(|r| RingPoints { id: r.id, polygon: polygon_id, points: arena.ring_points(r), crs: key }).collect();
        let material = self.resolve_material(geometry, polygon.node, &rings, surface, sources, report)?;
        if material.invisible {
            report.omit(Reason::PolygonTransparent, 1);
            return Ok(());
        }
        if !self.assemble_rings(&rings, material.textured, surface, report)? {
            return Ok(());
        }
        let crs = if self.is_prototype { DOCUMENT_CRS } else { arena.node(polygon.node).crs };
        let scale = self.scales.get(crs as usize).filter(|_| !self.is_prototype);
        self.triangulator.set_scale(scale.copied().unwrap_or([1.0; 3]));
        match self.triangulator.triangulate(&self.points, &self.ring_ends) {
            Err(error) => return report.skip(error.reason(), || surface.object_name.to_owned()),
            Ok(Coverage::Inexact) => report.warn(Reason::RingsCross, surface.object_name)?,
            Ok(Coverage::Exact) => {}
        }
        let is_flat = arena.node(polygon.node).is_flat;
        if is_flat {
            report.warn(Reason::PolygonWithoutHeight, surface.object_name)?;
        }
        self.note_heights(surface.object, is_flat);
        self.push_triangles(crs, polygon.reversed, surface, material);
        report.check_limit(LimitCheck::triangles(self.triangles, self.options.max_triangles))
    }

    fn resolve_material(
        &mut self,
        geometry: LinkedGeometry,
        node: NodeId,
        rings: &[RingPoints],
        surface: &ThematicSurface,
        sources: &mut MaterialSources,
        report: &mut ReportBuilder,
    ) -> Result<ResolvedMaterial> {
        let MaterialSources { resolver, appearances } = sources;
        let mut material = None;
        let ring = rings.first().map_or(ids::NONE, |ring| ring.id);
        if ring != ids::NONE && appearances.iter().any(|a| a.has_target(ring)) {
            material = resolver.resolve(&[ring], rings, appearances, &mut self.source_uvs, report)?;
            if material.is_some() {
                report.note(Reason::AppearanceTargetIsRing, surface.object_name);
            }
        }
        if material.is_none() && appearances.iter().any(|a| !a.is_empty()) {
            self.target_ids.clear();
            geometry.append_target_ids(node, &mut self.target_ids);
            self.target_ids.extend(surface.feature_ids.iter().filter(|id| **id != ids::NONE));
            material = resolver.resolve(&self.target_ids, rings, appearances, &mut self.source_uvs, report)?;
        }
        Ok(material.unwrap_or_else(|| resolver.resolve_default(surface.type_names)))
    }

    /// Opens the rings and drops repeated points. Skips broken interior rings. Returns false if the polygon is skipped.
    fn assemble_rings(&mut self, rings: &[RingPoints], textured: bool, surface: &ThematicSurface, report: &mut ReportBuilder) -> Result<bool> {
        self.points.clear();
        self.uvs.clear();
        self.ring_ends.clear();
        let mut source_start = 0;
        for (k, ring) in rings.iter().enumerate() {
            let uvs = textured.then(|| &self.source_uvs[source_start..source_start + ring.points.len()]);
            source_start += ring.points.len();
            let start = self.points.len();
            append_open_ring(ring.points, uvs, &mut self.points, &mut self.uvs);
            let limit = self.options.max_ring_vertices;
            let reason: Message = match self.points.len() - start {
                0..3 => Reason::RingWithTooFewPoints.into(),
                n if n as u64 > limit => Reason::RingOverLimit.with("limit", limit),
                _ => {
                    self.ring_ends.push(self.points.len());
                    if ring.points.first() != ring.points.last() {
                        report.warn(Reason::RingNotClosed, surface.object_name)?;
                    }
                    continue;
                }
            };
            report.skip(reason, || surface.object_name.to_owned())?;
            self.points.truncate(start);
            self.uvs.truncate(if textured { start } else { 0 });
            if k == 0 {
                return Ok(false);
            }
        }
        if rings.is_empty() {
            report.skip(Reason::PolygonWithoutRings, || surface.object_name.to_owned())?;
        }
        Ok(!rings.is_empty())
    }

    fn push_triangles(&mut self, crs: CrsNumber, reversed: bool, surface: &ThematicSurface, material: ResolvedMaterial) {
        let OpenBatch { batch, has_uvs } = find_open(&mut self.open, crs);
        let base = batch.positions.len() as u32;
        batch.positions.extend_from_slice(&self.points);
        *has_uvs |= material.textured;
        let triangles = self.triangulator.triangles().as_chunks::<3>().0;
        for t in triangles {
            let [a, b, c] = *t;
            let t = if reversed { [a, c, b] } else { [a, b, c] };
            batch.triangles.push(t.map(|i| base + i));
            let uvs = if material.textured { shift_uvs(t.map(|i| self.uvs[i as usize]), material.wrap) } else { Default::default() };
            batch.uvs.push(uvs);
            batch.materials.push(material.index);
            batch.objects.push(surface.object);
            batch.ranks.push(surface.rank);
        }
        self.triangles += triangles.len() as u64;
    }
}

/// Returns the batch for a coordinate system.
fn find_open(open: &mut Vec<OpenBatch>, crs: CrsNumber) -> &mut OpenBatch {
    let at = open.iter().position(|open| open.batch.crs == crs).unwrap_or_else(|| {
        open.push(OpenBatch { batch: Batch { crs, ..Batch::default() }, has_uvs: false });
        open.len() - 1
    });
    &mut open[at]
}

/// Appends a ring without repeated points and without its closing point.
fn append_open_ring(points: &[Vec3], uvs: Option<&[[f64; 2]]>, out: &mut Vec<Vec3>, uvs_out: &mut Vec<[f64; 2]>) {
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
