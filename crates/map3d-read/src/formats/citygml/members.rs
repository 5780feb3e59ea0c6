//! Where the city objects of a document are: in members of a city model or of a feature collection, as web feature services answer with; a member
//! may hold a collection in turn.

use crate::document::file_head::FileHead;

/// What an element is, from the root down to the city objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// Holds members, and properties of the whole.
    Collection,
    /// Holds city objects or collections.
    Member,
    CityObject,
    /// Anything else, which is not entered.
    Other,
}

/// Returns true for the beginning of a document that holds city objects.
pub fn is_city_model(head: &FileHead) -> bool {
    match head.xml_root() {
        Some("CityModel") => true,
        // Any features may be in a collection: those of CityGML show by their namespace.
        Some(name) => is_collection(name) && head.text().contains("citygml"),
        None => false,
    }
}

pub fn is_collection(name: &str) -> bool {
    matches!(name, "CityModel" | "FeatureCollection" | "SimpleFeatureCollection" | "GetFeatureResponse" | "Tuple")
}

fn is_member(name: &str) -> bool {
    matches!(name, "cityObjectMember" | "featureMember" | "featureMembers" | "member" | "additionalObjects")
}

/// The elements above the city objects that are open, from the root on.
#[derive(Debug, Default)]
pub struct OpenLevels(Vec<Level>);

impl OpenLevels {
    /// Returns what an element is that begins now, and enters it if it is a collection or a member.
    pub fn start(&mut self, name: &str) -> Level {
        let level = match self.0.last() {
            None | Some(Level::Member) if is_collection(name) => Level::Collection,
            Some(Level::Collection) if is_member(name) => Level::Member,
            Some(Level::Member) => Level::CityObject,
            // The answer of a service holds a collection without a member.
            Some(Level::Collection) if is_collection(name) => Level::Collection,
            _ => Level::Other,
        };
        if matches!(level, Level::Collection | Level::Member) {
            self.0.push(level);
        }
        level
    }

    /// Leaves the element entered last. Returns false if it was the root.
    pub fn end(&mut self) -> bool {
        self.0.pop();
        !self.0.is_empty()
    }

    pub fn depth(&self) -> usize {
        self.0.len()
    }

    pub fn is_in_collection(&self) -> bool {
        self.0.last() == Some(&Level::Collection)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn city_objects_are_in_members_of_collections() {
        for (path, expected) in [
            (&["CityModel", "cityObjectMember", "Building"][..], Level::CityObject),
            (&["FeatureCollection", "member", "Building"], Level::CityObject),
            (&["FeatureCollection", "member", "FeatureCollection", "member", "Building"], Level::CityObject),
            (&["FeatureCollection", "featureMember", "CityModel", "cityObjectMember", "Building"], Level::CityObject),
            (&["FeatureCollection", "additionalObjects", "SimpleFeatureCollection", "member", "Building"], Level::CityObject),
            (&["CityModel", "boundedBy"], Level::Other),
            (&["CityModel", "appearanceMember"], Level::Other),
            (&["Building"], Level::Other),
        ] {
            let mut levels = OpenLevels::default();
            assert_eq!(path.iter().map(|name| levels.start(name)).last(), Some(expected), "{path:?}");
        }
    }
}
