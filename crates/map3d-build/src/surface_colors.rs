//! Colours of surfaces to which the source gives none: by the style of the scene, else soft colours by surface class (spec/scene.md, Style).

use std::collections::{BTreeMap, HashMap};
use std::io::{BufRead, BufReader};
use std::path::Path;

use map3d_base::asset::{Object, SurfaceClass};
use map3d_base::{Error, Result};
use serde::{Deserialize, Serialize};
use twox_hash::XxHash3_64;

/// A rule of a style. It holds for surfaces that meet all conditions that are given.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StyleRule {
    /// sRGB.
    pub color: [u8; 3],
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surface: Option<SurfaceClass>,
    /// Class of the object or of one that it is part of.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub class: Option<String>,
    /// Attributes with these values, of the object or of one that it is part of.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub attributes: BTreeMap<String, String>,
}

/// Buildings have one of these tones each, so that neighbours differ.
const TONES: usize = 6;
const WALLS: [[u8; 3]; TONES] = [[237, 230, 215], [228, 219, 203], [221, 217, 211], [241, 236, 228], [232, 221, 198], [218, 210, 201]];
const ROOFS: [[u8; 3]; TONES] = [[178, 113, 95], [166, 105, 91], [187, 127, 107], [158, 111, 98], [148, 141, 138], [175, 119, 94]];

/// Returns the colour, sRGB, of a surface class that no rule colours.
fn default_color(class: SurfaceClass, tone: usize) -> [u8; 3] {
    match class {
        SurfaceClass::Wall => WALLS[tone],
        SurfaceClass::Roof => ROOFS[tone],
        SurfaceClass::Ground => [153, 148, 140],
        SurfaceClass::Window => [140, 168, 194],
        SurfaceClass::Door => [128, 97, 71],
        SurfaceClass::Road => [140, 140, 143],
        SurfaceClass::Water => [115, 153, 191],
        SurfaceClass::Vegetation => [107, 148, 89],
        SurfaceClass::Terrain => [168, 173, 148],
        SurfaceClass::Other => [204, 204, 204],
    }
}

/// The colours of an object's surfaces by class, as what they depend on.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
struct Palette {
    tone: u8,
    is_building: bool,
    /// Rules whose conditions on the object hold, in order.
    rules: Vec<u16>,
}

/// The colours of an asset's objects: a palette for each. Palette 0 is that of prototypes, which many objects share.
#[derive(Default)]
pub(crate) struct SurfaceColors {
    palettes: Vec<Palette>,
    by_object: Vec<u32>,
}

impl SurfaceColors {
    /// Reads an asset's `objects.jsonl`.
    pub fn read(path: &Path, rules: &[StyleRule]) -> Result<Self> {
        let file = std::fs::File::open(path).map_err(|e| Error::storage(path, e))?;
        let mut objects = Vec::new();
        for (number, line) in BufReader::new(file).lines().enumerate() {
            let line = line.map_err(|e| Error::storage(path, e))?;
            let object: Object = serde_json::from_str(&line).map_err(|e| Error::format(path, format!("line {}: {e}", number + 1)))?;
            objects.push(ObjectFacts::new(&object, number, rules));
        }
        Ok(Self::of_objects(&objects, rules))
    }

    fn of_objects(objects: &[ObjectFacts], rules: &[StyleRule]) -> Self {
        let mut palettes = vec![Palette { rules: unconditional(rules), ..Palette::default() }];
        let mut known: HashMap<Palette, u32> = HashMap::from([(palettes[0].clone(), 0)]);
        let by_object = (0..objects.len()).map(|number| {
            let palette = palette_of(objects, number, rules);
            if let Some(known) = known.get(&palette) {
                return *known;
            }
            known.insert(palette.clone(), palettes.len() as u32);
            palettes.push(palette);
            palettes.len() as u32 - 1
        });
        let by_object = by_object.collect();
        Self { palettes, by_object }
    }

    pub fn len(&self) -> usize {
        self.palettes.len()
    }

    /// Returns the index of an object's palette; that of prototypes for `None`.
    pub fn of(&self, object: Option<u32>) -> usize {
        object.and_then(|o| self.by_object.get(o as usize)).map_or(0, |palette| *palette as usize)
    }

    /// Returns the colour of a surface as sRGB and opacity.
    pub fn color(&self, palette: usize, class: SurfaceClass, rules: &[StyleRule]) -> [u8; 4] {
        let palette = &self.palettes[palette];
        let rule = palette.rules.iter().map(|k| &rules[usize::from(*k)]).find(|r| r.surface.is_none_or(|s| s == class));
        let [r, g, b] = rule.map_or_else(|| default_color(class, usize::from(palette.tone)), |r| r.color);
        [r, g, b, 255]
    }

    /// Returns the class of a triangle's surface: where the source does not say, what a building has in that direction. `up`: the z of its unit normal.
    pub fn class(&self, palette: usize, class: SurfaceClass, up: impl FnOnce() -> f64) -> SurfaceClass {
        match class {
            SurfaceClass::Other if self.palettes[palette].is_building => {
                if up() > ROOF_UP {
                    SurfaceClass::Roof
                } else {
                    SurfaceClass::Wall
                }
            }
            class => class,
        }
    }
}

/// The z of the unit normal above which a building's surface is a roof: up to 70° steep.
const ROOF_UP: f64 = 0.34;

/// What the palette of an object depends on.
struct ObjectFacts {
    parent: Option<u32>,
    is_building: bool,
    hash: u64,
    /// For each rule, whether this object alone meets its condition on the class, and each of those on attributes.
    met: Vec<Vec<bool>>,
}

impl ObjectFacts {
    fn new(object: &Object, number: usize, rules: &[StyleRule]) -> Self {
        let name = if object.name.is_empty() { format!("{number}") } else { object.name.clone() };
        let has = |(name, value): (&String, &String)| object.attributes.get(name).is_some_and(|v| text_of(v) == *value);
        let met = |rule: &StyleRule| {
            let class = rule.class.as_ref().is_none_or(|c| *c == object.class);
            std::iter::once(class).chain(rule.attributes.iter().map(has)).collect()
        };
        Self {
            parent: object.parent,
            is_building: object.class.starts_with("building"),
            hash: XxHash3_64::oneshot(name.as_bytes()),
            met: rules.iter().map(met).collect(),
        }
    }
}

fn text_of(value: &serde_json::Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// Returns the rules without conditions on the object.
fn unconditional(rules: &[StyleRule]) -> Vec<u16> {
    let holds = |r: &StyleRule| r.class.is_none() && r.attributes.is_empty();
    rules.iter().zip(0..).filter(|(r, _)| holds(r)).map(|(_, k)| k).collect()
}

/// Levels of parts within parts that are looked at, so that objects that are parts of each other end.
const MAX_DEPTH: usize = 32;

fn palette_of(objects: &[ObjectFacts], number: usize, rules: &[StyleRule]) -> Palette {
    let parent = |o: &&ObjectFacts| o.parent.and_then(|p| objects.get(p as usize));
    let line: Vec<&ObjectFacts> = std::iter::successors(objects.get(number), parent).take(MAX_DEPTH).collect();
    let is_building = line.iter().any(|o| o.is_building);
    let holds = |k: usize| (0..=rules[k].attributes.len()).all(|c| line.iter().any(|o| o.met[k][c]));
    Palette {
        tone: if is_building { line.last().map_or(0, |o| (o.hash % TONES as u64) as u8) } else { 0 },
        is_building,
        rules: (0..rules.len()).filter(|k| holds(*k)).map(|k| k as u16).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn object(name: &str, class: &str, parent: Option<u32>, attributes: &[(&str, serde_json::Value)]) -> Object {
        let attributes = attributes.iter().map(|(k, v)| ((*k).to_owned(), v.clone())).collect();
        Object { name: name.into(), class: class.into(), parent, lod: None, attributes, without_height: false }
    }

    fn surface_colors(objects: &[Object], rules: &[StyleRule]) -> SurfaceColors {
        let facts: Vec<_> = objects.iter().enumerate().map(|(k, o)| ObjectFacts::new(o, k, rules)).collect();
        SurfaceColors::of_objects(&facts, rules)
    }

    fn rule(color: u8) -> StyleRule {
        StyleRule { color: [color; 3], surface: None, class: None, attributes: BTreeMap::new() }
    }

    #[test]
    fn the_first_rule_whose_conditions_hold_gives_the_colour() {
        let school = BTreeMap::from([("function".to_owned(), "school".to_owned())]);
        let storeys = BTreeMap::from([("storeys".to_owned(), "3".to_owned())]);
        let rules = [
            StyleRule { surface: Some(SurfaceClass::Roof), attributes: school.clone(), ..rule(1) },
            StyleRule { attributes: school, ..rule(2) },
            StyleRule { class: Some("building".into()), attributes: storeys, ..rule(3) },
            StyleRule { surface: Some(SurfaceClass::Road), ..rule(4) },
        ];
        let objects = [
            object("a", "building", None, &[("function", "school".into())]),
            object("b", "building_part", Some(0), &[]),
            object("c", "building", None, &[("storeys", 3.into())]),
            object("d", "bridge", None, &[("storeys", 3.into())]),
        ];
        let colors = surface_colors(&objects, &rules);
        let red = |object: u32, class| colors.color(colors.of(Some(object)), class, &rules)[0];
        assert_eq!([red(0, SurfaceClass::Roof), red(0, SurfaceClass::Wall)], [1, 2]);
        assert_eq!([red(1, SurfaceClass::Roof), red(1, SurfaceClass::Wall)], [1, 2], "a part is its building's");
        assert_eq!(red(2, SurfaceClass::Wall), 3, "a number is compared by its digits");
        assert_eq!(red(3, SurfaceClass::Other), 204, "class and attribute must both hold");
        assert_eq!(colors.color(colors.of(None), SurfaceClass::Road, &rules), [4, 4, 4, 255], "prototypes too");
    }

    #[test]
    fn a_part_has_the_tone_of_its_building_and_buildings_differ() {
        let mut objects: Vec<_> = (0..40).map(|k| object(&format!("house {k}"), "building", None, &[])).collect();
        objects.push(object("part", "building_part", Some(7), &[]));
        let colors = surface_colors(&objects, &[]);
        let wall = |object: u32| colors.color(colors.of(Some(object)), SurfaceClass::Wall, &[]);
        assert_eq!(wall(40), wall(7));
        let tones: std::collections::BTreeSet<_> = (0..40).map(wall).collect();
        assert_eq!(tones.len(), TONES);
    }

    #[test]
    fn a_building_without_named_surfaces_has_roofs_and_walls() {
        let colors = surface_colors(&[object("a", "building", None, &[]), object("b", "bridge", None, &[])], &[]);
        let class = |object, up| colors.class(colors.of(Some(object)), SurfaceClass::Other, || up);
        assert_eq!([class(0, 0.8), class(0, 0.0), class(0, -1.0)], [SurfaceClass::Roof, SurfaceClass::Wall, SurfaceClass::Wall]);
        assert_eq!(class(1, 0.8), SurfaceClass::Other);
        assert_eq!(colors.class(colors.of(Some(0)), SurfaceClass::Wall, || 0.8), SurfaceClass::Wall, "what the source says stays");
    }

    #[test]
    fn more_objects_than_65535_may_all_look_different() {
        const BITS: usize = 17;
        let bit = |k: usize| format!("bit {k}");
        let rules: Vec<_> = (0..BITS).map(|k| StyleRule { attributes: BTreeMap::from([(bit(k), "1".into())]), ..rule(k as u8) }).collect();
        let facts: Vec<_> = (0..70_000usize)
            .map(|number| {
                let attributes: Vec<_> = (0..BITS).filter(|k| number >> k & 1 == 1).map(|k| (bit(k), 1.into())).collect();
                let attributes: Vec<_> =
                    attributes.iter().map(|(name, value): &(String, serde_json::Value)| (name.as_str(), value.clone())).collect();
                ObjectFacts::new(&object("a", "bridge", None, &attributes), number, &rules)
            })
            .collect();
        let colors = SurfaceColors::of_objects(&facts, &rules);
        assert_eq!(colors.len(), facts.len());
        for number in 1..facts.len() as u32 {
            assert_eq!(colors.color(colors.of(Some(number)), SurfaceClass::Wall, &rules)[0], number.trailing_zeros() as u8, "{number}");
        }
    }

    #[test]
    fn objects_that_are_parts_of_each_other_end() {
        let objects = [object("a", "building", Some(1), &[]), object("b", "building", Some(0), &[]), object("c", "building", Some(99), &[])];
        assert_eq!(surface_colors(&objects, &[]).by_object.len(), 3);
    }
}
