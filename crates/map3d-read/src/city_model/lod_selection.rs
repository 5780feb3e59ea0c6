//! Selects the level of detail at which each feature is converted.

use super::city_object::{CityObject, LodRepresentation, Representation};
use super::feature_types::FeatureKind;

/// Features of one object that are converted at one level: a level of another one would show the same thing twice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Group {
    /// The object itself and its boundary surfaces.
    Shell,
    Openings,
    /// Installations with their surfaces and openings.
    Installations,
    Interiors,
}

/// Levels of detail at which a group has representations: bit n is level n.
#[derive(Clone, Copy, Debug, Default)]
struct Levels(u8);

impl Levels {
    fn has(self, lod: u8) -> bool {
        self.0 >> lod & 1 == 1
    }

    fn finest(self) -> Option<u8> {
        self.0.checked_ilog2().map(|lod| lod as u8)
    }
}

/// The levels of an object's groups, in the order of `Group`.
type GroupLevels = [Levels; 4];

/// Returns the level of detail of each feature; `None` if it is not converted. `requested`: the level for all features; by default, the finest of
/// each object's shell. Openings, installations and interiors that have no such level are converted at their own finest.
pub fn select_lods(city_object: &CityObject, requested: Option<u8>) -> Vec<Option<u8>> {
    if requested.is_some() {
        return vec![requested; city_object.features.len()];
    }
    let groups: Vec<(u32, Group)> = (0..city_object.features.len() as u32).map(|f| find_group(city_object, f)).collect();
    let levels = find_levels(city_object, &groups);
    let shell_lods: Vec<Option<u8>> = levels.iter().map(|levels| levels[Group::Shell as usize].finest()).collect();
    let part_lods = find_finest_part_lods(city_object, &shell_lods);
    let select = |(object, group): &(u32, Group)| {
        let (shell, part) = (shell_lods[*object as usize], part_lods[*object as usize]);
        let own = levels[*object as usize][*group as usize];
        let is_replaced_by_parts = part > shell;
        match group {
            Group::Shell => shell.filter(|_| !is_replaced_by_parts),
            _ => match part.max(shell).filter(|lod| own.has(*lod)) {
                None if is_replaced_by_parts => own.finest().filter(|lod| Some(*lod) > shell),
                None => own.finest(),
                lod => lod,
            },
        }
    };
    groups.iter().map(select).collect()
}

/// Returns the object of a feature, and the group to which the feature belongs there.
fn find_group(city_object: &CityObject, feature: u32) -> (u32, Group) {
    let object = city_object.find_object(feature);
    let is_within = |kind: FeatureKind| {
        let within = city_object.with_ancestors(feature).take_while(|f| *f != object);
        within.map(|f| city_object.features[f as usize].kind).any(|k| k == kind)
    };
    let group = match () {
        () if city_object.features[feature as usize].is_interior => Group::Interiors,
        () if is_within(FeatureKind::Installation) => Group::Installations,
        () if is_within(FeatureKind::Opening) => Group::Openings,
        () => Group::Shell,
    };
    (object, group)
}

/// Returns the levels of the groups of each feature that is an object.
fn find_levels(city_object: &CityObject, groups: &[(u32, Group)]) -> Vec<GroupLevels> {
    let mut levels = vec![GroupLevels::default(); groups.len()];
    for (feature, (object, group)) in city_object.features.iter().zip(groups) {
        for representation in &feature.representations {
            levels[*object as usize][*group as usize].0 |= 1 << representation.lod;
        }
    }
    levels
}

/// Returns the finest level among the parts of each object. Where it is finer than the object's own shell, the parts replace the shell.
fn find_finest_part_lods(city_object: &CityObject, shell_lods: &[Option<u8>]) -> Vec<Option<u8>> {
    let mut finest = vec![None; city_object.features.len()];
    for (f, _) in city_object.features.iter().enumerate().filter(|(_, feature)| feature.kind == FeatureKind::Part) {
        for ancestor in city_object.with_ancestors(f as u32).skip(1) {
            finest[ancestor as usize] = shell_lods[f].max(finest[ancestor as usize]);
        }
    }
    finest
}

/// Iterates over the representations at one level; roof edges only if there is no other representation.
pub fn representations_at(representations: &[LodRepresentation], lod: u8) -> impl Iterator<Item = Representation> + '_ {
    let is_roof_edge = |r: &LodRepresentation| matches!(r.representation, Representation::RoofEdge(_));
    let has_other = representations.iter().any(|r| r.lod == lod && !is_roof_edge(r));
    representations.iter().filter(move |r| r.lod == lod && !(has_other && is_roof_edge(r))).map(|r| r.representation)
}
