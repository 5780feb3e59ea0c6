//! City objects and their surfaces, as parsed: one top-level city object with everything in it.

use std::collections::BTreeMap;

use map3d_base::asset::Rank;
use serde_json::Value;

use super::appearance::Appearances;
use super::geometry::{Geometry, NodeId};
use super::ids::{Id, IdMap};
use super::implicit::Implicit;
use super::kinds::Kind;

pub type Attributes = BTreeMap<String, Value>;

/// What is placed at a level of detail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    Surfaces(NodeId),
    /// A roof's outline at LoD 0: drawn where there is no footprint.
    RoofEdge(NodeId),
    /// Index into `Member::implicits`.
    Implicit(u32),
}

#[derive(Clone, Copy, Debug)]
pub struct Placed {
    pub lod: u8,
    pub form: Form,
}

#[derive(Debug)]
pub struct Feature {
    pub id: Id,
    /// The gml:id as written; empty without one. Kept for objects and parts only.
    pub name: String,
    pub local: String,
    pub kind: Kind,
    pub parent: Option<u32>,
    pub rank: Rank,
    /// Inside a building: drawn only where something outside refers to it.
    pub interior: bool,
    pub lod_hint: Option<u8>,
    pub placed: Vec<Placed>,
    /// References to other features (an opening that a room and a wall share).
    pub links: Vec<Id>,
    pub attributes: Attributes,
}

impl Feature {
    pub fn is_object(&self) -> bool {
        matches!(self.kind, Kind::Object | Kind::Part)
    }
}

/// A top-level city object. Reused from one to the next.
#[derive(Default)]
pub struct Member {
    /// Parents before their children; the first is the city object itself.
    pub features: Vec<Feature>,
    pub by_id: IdMap<u32>,
    pub geometry: Geometry,
    pub implicits: Vec<Implicit>,
    pub appearances: Appearances,
}

impl Member {
    pub fn clear(&mut self) {
        self.features.clear();
        self.by_id.clear();
        self.geometry.clear();
        self.implicits.clear();
        self.appearances.clear();
    }

    /// The nearest feature at or above this one that is an object.
    pub fn object_of(&self, mut feature: u32) -> u32 {
        loop {
            let f = &self.features[feature as usize];
            match f.parent {
                Some(parent) if !f.is_object() => feature = parent,
                _ => return feature,
            }
        }
    }
}
