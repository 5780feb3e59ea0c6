//! Code lists of public standards that city models use without a dictionary beside them: SIG3D (CityGML, annex C), AdV, PLATEAU, JIS.
//! Labels are in the language of the list.

use std::collections::HashMap;
use std::sync::LazyLock;

/// A code as the document writes it.
#[derive(Clone, Copy, Debug)]
pub struct Code<'a> {
    /// Local name of the property that has it.
    pub property: &'a str,
    pub space: Option<&'a str>,
    pub text: &'a str,
    /// The object has codes of the German cadastre.
    pub is_adv: bool,
}

/// Labels by code.
type StandardList = LazyLock<HashMap<&'static str, &'static str>>;

static ADV_BUILDING_FUNCTION: StandardList = LazyLock::new(|| parse(include_str!("code_lists/adv_building_function.txt")));
static ADV_ROOF_TYPE: StandardList = LazyLock::new(|| parse(include_str!("code_lists/adv_roof_type.txt")));
static SIG3D_ROOF_TYPE: StandardList = LazyLock::new(|| parse(include_str!("code_lists/sig3d_roof_type.txt")));
static SIG3D_BUILDING_CLASS: StandardList = LazyLock::new(|| parse(include_str!("code_lists/sig3d_building_class.txt")));
static SIG3D_BUILDING_FUNCTION: StandardList = LazyLock::new(|| parse(include_str!("code_lists/sig3d_building_function.txt")));
static PLATEAU_BUILDING_USAGE: StandardList = LazyLock::new(|| parse(include_str!("code_lists/plateau_building_usage.txt")));
static PLATEAU_BUILDING_STRUCTURE: StandardList = LazyLock::new(|| parse(include_str!("code_lists/plateau_building_structure.txt")));
static JIS_PREFECTURE: StandardList = LazyLock::new(|| parse(include_str!("code_lists/jis_prefecture.txt")));

/// Parses lines of a code, a tab and a label.
fn parse(text: &'static str) -> HashMap<&'static str, &'static str> {
    text.lines().filter(|line| !line.starts_with('#')).filter_map(|line| line.split_once('\t')).collect()
}

/// Returns the label of a code in the list that its code space names or, without one, in the list that its form leaves no doubt about.
pub fn find_standard_label(code: Code) -> Option<&'static str> {
    let lists: &[&StandardList] = match code.space.map(stem) {
        _ if is_adv_code(code.text) => &[&ADV_BUILDING_FUNCTION],
        Some("_AbstractBuilding_roofType") => &[&SIG3D_ROOF_TYPE],
        Some("_AbstractBuilding_class") => &[&SIG3D_BUILDING_CLASS],
        Some("_AbstractBuilding_function" | "_AbstractBuilding_usage") => &[&SIG3D_BUILDING_FUNCTION],
        Some("RoofTypeTypeAdV") => &[&ADV_ROOF_TYPE],
        Some("Building_usage") => &[&PLATEAU_BUILDING_USAGE],
        Some("Building_BuildingStructureType" | "BuildingDetailAttribute_buildingStructureType") => &[&PLATEAU_BUILDING_STRUCTURE],
        Some("Common_localPublicAuthorities" | "Common_prefecture") => &[&JIS_PREFECTURE],
        None if code.property == "roofType" && code.is_adv => &[&ADV_ROOF_TYPE],
        // Apart from 1000, a flat roof in both, the lists have no code in common.
        None if code.property == "roofType" => &[&SIG3D_ROOF_TYPE, &ADV_ROOF_TYPE],
        _ => &[],
    };
    lists.iter().find_map(|list| list.get(code.text).copied())
}

/// Returns true for a code of the German cadastre: five digits of the object type, an underscore, four digits.
pub fn is_adv_code(text: &str) -> bool {
    let digits = |part: &str, count: usize| part.len() == count && part.bytes().all(|b| b.is_ascii_digit());
    text.split_once('_').is_some_and(|(object_type, function)| digits(object_type, 5) && digits(function, 4))
}

/// Returns the file name of a code space without its extension.
fn stem(space: &str) -> &str {
    let name = space.trim().rsplit(['/', '\\']).next().unwrap_or_default();
    name.rsplit_once('.').map_or(name, |(stem, _)| stem)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_decoded_only_where_their_list_is_certain() {
        const SIG3D: &str = "http://www.sig3d.org/codelists/standard/building/2.0/_AbstractBuilding_function.xml";
        for (property, space, text, is_adv, expected) in [
            ("function", None, "31001_2463", false, Some("Garage")),
            ("function", None, "31001_0001", false, None),
            ("function", None, "1000", false, None),
            ("function", Some(SIG3D), "1000", false, Some("residential building")),
            ("roofType", None, "1030", false, Some("gabled roof")),
            ("roofType", None, "3100", false, Some("Satteldach")),
            ("roofType", None, "1000", true, Some("Flachdach")),
            ("roofType", None, "1000", false, Some("flat roof")),
            ("roofType", Some("My_roofs.xml"), "1000", false, None),
            ("usage", Some("../../codelists/Building_usage.xml"), "422", false, Some("文教厚生施設")),
            ("city", Some("../../codelists/Common_localPublicAuthorities.xml"), "14", false, Some("神奈川県")),
            ("city", Some("../../codelists/Common_localPublicAuthorities.xml"), "14201", false, None),
        ] {
            assert_eq!(find_standard_label(Code { property, space, text, is_adv }), expected, "{property} {space:?} {text}");
        }
    }

    #[test]
    fn every_line_of_a_list_is_a_code_and_a_label() {
        for (list, count) in [(&ADV_BUILDING_FUNCTION, 234), (&ADV_ROOF_TYPE, 15), (&SIG3D_ROOF_TYPE, 14), (&JIS_PREFECTURE, 47)] {
            assert_eq!(list.len(), count);
            assert!(list.iter().all(|(code, label)| !code.is_empty() && !label.is_empty()));
        }
    }
}
