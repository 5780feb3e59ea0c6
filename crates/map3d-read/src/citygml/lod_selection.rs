//! Selects the level of detail at which each feature is converted.

use super::city_object::{CityObject, LodRepresentation, Representation};
use super::feature_types::FeatureKind;

/// Returns the level of detail of each feature; `None` if it is not converted. `requested`: the level for all features; by default, the finest.
pub fn select_lods(city_object: &CityObject, requested: Option<u8>) -> Vec<Option<u8>> {
    if requested.is_some() {
        return vec![requested; city_object.features.len()];
    }
    let objects: Vec<u32> = (0..city_object.features.len() as u32).map(|f| city_object.find_object(f)).collect();
    let shell_lods = find_shell_lods(city_object, &objects);
    let part_lods = find_finest_part_lods(city_object, &shell_lods);
    let select = |f: usize| {
        let object = objects[f] as usize;
        let is_replaced_by_parts = part_lods[object] > shell_lods[object];
        match shell_lods[object] {
            shell @ Some(_) if is_shell(city_object, f) => shell.filter(|_| !is_replaced_by_parts),
            Some(shell) if is_replaced_by_parts && has_lod(city_object, f, shell) => None,
            Some(shell) if has_lod(city_object, f, shell) => Some(shell),
            _ => find_finest_lod(city_object, f),
        }
    };
    (0..city_object.features.len()).map(select).collect()
}

/// Returns true if a feature belongs to the shell of its object: the object itself and its boundary surfaces, but not openings and installations.
fn is_shell(city_object: &CityObject, feature: usize) -> bool {
    !matches!(city_object.features[feature].kind, FeatureKind::Opening | FeatureKind::Installation) && !is_in_installation(city_object, feature)
}

fn is_in_installation(city_object: &CityObject, feature: usize) -> bool {
    let features = &city_object.features;
    let ancestors = city_object.with_ancestors(feature as u32).skip(1);
    ancestors.take_while(|a| !features[*a as usize].is_object()).any(|a| features[a as usize].kind == FeatureKind::Installation)
}

fn lods(city_object: &CityObject, feature: usize) -> impl Iterator<Item = u8> + '_ {
    city_object.features[feature].representations.iter().map(|r| r.lod)
}

fn has_lod(city_object: &CityObject, feature: usize, lod: u8) -> bool {
    lods(city_object, feature).any(|l| l == lod)
}

fn find_finest_lod(city_object: &CityObject, feature: usize) -> Option<u8> {
    lods(city_object, feature).max()
}

/// Returns the finest level of each object's shell.
fn find_shell_lods(city_object: &CityObject, objects: &[u32]) -> Vec<Option<u8>> {
    let mut shell_lods: Vec<Option<u8>> = vec![None; city_object.features.len()];
    for f in (0..city_object.features.len()).filter(|f| !city_object.features[*f].is_interior && is_shell(city_object, *f)) {
        let lod = &mut shell_lods[objects[f] as usize];
        *lod = (*lod).max(find_finest_lod(city_object, f));
    }
    shell_lods
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
