//! One top-level city object with all features in it, as parsed.

use map3d_base::asset::Rank;

use super::appearance::Appearances;
use super::attributes::Attributes;
use super::crs_table::CrsNumber;
use super::feature_types::FeatureKind;
use super::geometry_arena::{GeometryArena, GeometryNode, NodeId, NodeKind};
use super::ids::{Id, IdMap};
use super::implicit_geometry::ImplicitGeometry;
use super::lifespan::Lifespan;
use crate::document::ReliefGrid;

/// A geometry property of a feature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Representation {
    Surfaces(NodeId),
    /// `lod0RoofEdge`; converted only if there is no footprint.
    RoofEdge(NodeId),
    /// Index into `CityObject::implicit_geometries`.
    Implicit(u32),
    /// Index into `CityObject::grids`.
    Raster(u32),
}

#[derive(Clone, Copy, Debug)]
pub struct LodRepresentation {
    pub lod: u8,
    pub representation: Representation,
}

/// An object, part, boundary surface, opening, … of a city object.
#[derive(Debug)]
pub struct Feature {
    pub id: Id,
    /// The gml:id of objects and parts as written; empty without one, and for other kinds.
    pub name: String,
    /// Local name of the element.
    pub type_name: String,
    pub kind: FeatureKind,
    pub parent: Option<u32>,
    pub rank: Rank,
    /// Inside a building; converted only on request, or if a feature outside refers to it.
    pub is_interior: bool,
    pub lifespan: Lifespan,
    /// Does not exist at the date of the conversion.
    pub is_left_out: bool,
    /// Coordinate system of geometry that names none: that of the nearest envelope.
    pub crs: CrsNumber,
    /// Content of a `lod` property of this feature or its parent (relief).
    pub relief_lod: Option<u8>,
    /// Nodes of the polygons outside of which a relief is not valid: the first, and the one after the last.
    pub extent: Option<(NodeId, NodeId)>,
    pub representations: Vec<LodRepresentation>,
    /// References to other features, such as an opening that a room and a wall share.
    pub xlinks: Vec<Id>,
    pub attributes: Attributes,
    /// Attributes are kept: those of objects, and those of data types, which go to the object that contains them.
    pub keeps_attributes: bool,
}

impl Feature {
    pub fn is_object(&self) -> bool {
        matches!(self.kind, FeatureKind::Object | FeatureKind::Part)
    }
}

/// A top-level city object. Buffers are reused for the next one.
#[derive(Default)]
pub struct CityObject {
    /// Parents before their children; the first is the city object itself.
    pub features: Vec<Feature>,
    pub by_id: IdMap<u32>,
    pub geometry: GeometryArena,
    pub implicit_geometries: Vec<ImplicitGeometry>,
    pub grids: Vec<ReliefGrid>,
    pub appearances: Appearances,
}

impl CityObject {
    pub fn clear(&mut self) {
        self.features.clear();
        self.by_id.clear();
        self.geometry.clear();
        self.implicit_geometries.clear();
        self.grids.clear();
        self.appearances.clear();
    }

    /// Returns true if anything could be drawn.
    pub fn has_geometry(&self) -> bool {
        let is_polygon = |node: &GeometryNode| matches!(node.kind, NodeKind::Polygon { .. });
        !self.implicit_geometries.is_empty() || !self.grids.is_empty() || self.geometry.nodes.iter().any(is_polygon)
    }

    /// Iterates over a feature and its ancestors, from the feature up.
    pub fn with_ancestors(&self, feature: u32) -> impl Iterator<Item = u32> + '_ {
        std::iter::successors(Some(feature), |f| self.features[*f as usize].parent)
    }

    /// Returns the nearest feature at or above this one that is an object or part.
    pub fn find_object(&self, mut feature: u32) -> u32 {
        loop {
            let f = &self.features[feature as usize];
            match f.parent {
                Some(parent) if !f.is_object() => feature = parent,
                _ => return feature,
            }
        }
    }

    /// Marks the descendants of interior features as interior: a feature may say where it is after it has listed its surfaces.
    pub fn extend_interiors(&mut self) {
        for f in 0..self.features.len() {
            let is_inside = self.features[f].parent.is_some_and(|p| self.features[p as usize].is_interior);
            self.features[f].is_interior |= is_inside;
        }
    }

    /// Marks interior features that a feature outside refers to (a door between room and street) as not interior, with their descendants.
    pub fn expose_shared_interiors(&mut self) {
        let mut exposed = vec![false; self.features.len()];
        for id in self.features.iter().filter(|f| !f.is_interior).flat_map(|f| &f.xlinks) {
            if let Some(f) = self.by_id.get(id) {
                exposed[*f as usize] = true;
            }
        }
        for f in 0..self.features.len() {
            exposed[f] |= self.features[f].parent.is_some_and(|p| exposed[p as usize]);
            self.features[f].is_interior &= !exposed[f];
        }
    }
}
