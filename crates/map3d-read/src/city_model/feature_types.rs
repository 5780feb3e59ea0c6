//! Classifies CityGML feature types (element names): kind, class rank, default colour, class name.

use map3d_base::asset::{Rank, SurfaceClass};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FeatureKind {
    /// A city object with its own id and attributes.
    Object,
    /// A city object that is part of its parent object.
    Part,
    /// A boundary surface of the parent object: wall, roof, traffic area, …
    Surface,
    /// A door or window.
    Opening,
    /// A balcony, chimney, dormer, …
    Installation,
    /// Inside a building; converted on request.
    Interior,
    /// Not a CityGML feature type, but may contain features.
    Unknown,
}

pub fn classify_feature(type_name: &str) -> FeatureKind {
    match type_name {
        "BuildingPart" | "BridgePart" | "TunnelPart" => FeatureKind::Part,
        "Building"
        | "Bridge"
        | "Tunnel"
        | "Road"
        | "Railway"
        | "Track"
        | "Square"
        | "TransportationComplex"
        | "WaterBody"
        | "LandUse"
        | "PlantCover"
        | "SolitaryVegetationObject"
        | "CityFurniture"
        | "GenericCityObject"
        | "CityObjectGroup"
        | "ReliefFeature"
        | "Waterway"
        | "OtherConstruction"
        | "GenericOccupiedSpace"
        | "GenericUnoccupiedSpace"
        | "GenericLogicalSpace" => FeatureKind::Object,
        "WallSurface"
        | "RoofSurface"
        | "GroundSurface"
        | "ClosureSurface"
        | "OuterCeilingSurface"
        | "OuterFloorSurface"
        | "TrafficArea"
        | "AuxiliaryTrafficArea"
        | "WaterSurface"
        | "WaterGroundSurface"
        | "WaterClosureSurface"
        | "Section"
        | "Intersection"
        | "TrafficSpace"
        | "AuxiliaryTrafficSpace"
        | "Marking"
        | "Hole"
        | "HoleSurface"
        | "GenericThematicSurface"
        | "TINRelief"
        | "MassPointRelief"
        | "BreaklineRelief"
        | "RasterRelief" => FeatureKind::Surface,
        "Window" | "Door" | "WindowSurface" | "DoorSurface" => FeatureKind::Opening,
        "BuildingInstallation"
        | "BridgeInstallation"
        | "TunnelInstallation"
        | "BridgeConstructionElement"
        | "BuildingConstructiveElement"
        | "BridgeConstructiveElement"
        | "TunnelConstructiveElement" => FeatureKind::Installation,
        "Room"
        | "BuildingRoom"
        | "BridgeRoom"
        | "HollowSpace"
        | "BuildingFurniture"
        | "BridgeFurniture"
        | "TunnelFurniture"
        | "IntBuildingInstallation"
        | "IntBridgeInstallation"
        | "IntTunnelInstallation"
        | "InteriorWallSurface"
        | "CeilingSurface"
        | "FloorSurface"
        | "Storey"
        | "BuildingUnit" => FeatureKind::Interior,
        _ => FeatureKind::Unknown,
    }
}

/// Returns true for an open space of CityGML 3.0: its solid is air, only its boundary is there.
pub fn is_open_space(type_name: &str) -> bool {
    matches!(type_name, "TrafficSpace" | "AuxiliaryTrafficSpace" | "ClearanceSpace" | "Hole" | "GenericUnoccupiedSpace")
}

/// Returns true for a part of a building's inside whose attributes are those of the building.
pub fn is_subdivision(type_name: &str) -> bool {
    matches!(type_name, "Storey" | "BuildingUnit")
}

/// Returns the class rank of a city object's surfaces.
pub fn rank_object(type_name: &str) -> Rank {
    match type_name {
        "Road" | "Railway" | "Track" | "Square" | "TransportationComplex" | "WaterBody" | "Waterway" => Rank::Road,
        "LandUse" | "ReliefFeature" | "RasterRelief" => Rank::Terrain,
        _ => Rank::Other,
    }
}

/// Returns the class rank of a feature from its kind, type and parent's rank.
pub fn rank_feature(kind: FeatureKind, type_name: &str, parent: Rank) -> Rank {
    match kind {
        FeatureKind::Object | FeatureKind::Part => rank_object(type_name),
        FeatureKind::Opening => Rank::Opening,
        FeatureKind::Installation => Rank::Installation,
        FeatureKind::Surface if type_name == "GroundSurface" && parent == Rank::Other => Rank::Ground,
        FeatureKind::Surface | FeatureKind::Interior | FeatureKind::Unknown => parent,
    }
}

/// Returns the class of the surfaces of a feature, if its type says it.
pub fn classify_surface(type_name: &str) -> Option<SurfaceClass> {
    Some(match type_name {
        "WallSurface" | "InteriorWallSurface" => SurfaceClass::Wall,
        "RoofSurface" => SurfaceClass::Roof,
        "GroundSurface" => SurfaceClass::Ground,
        "Window" | "WindowSurface" => SurfaceClass::Window,
        "Door" | "DoorSurface" => SurfaceClass::Door,
        "Road" | "Square" | "Track" | "TransportationComplex" | "TrafficArea" | "TrafficSpace" | "Section" | "Intersection" | "Railway" => {
            SurfaceClass::Road
        }
        "WaterBody" | "WaterSurface" | "Waterway" => SurfaceClass::Water,
        "PlantCover" | "SolitaryVegetationObject" | "AuxiliaryTrafficArea" => SurfaceClass::Vegetation,
        "LandUse" | "ReliefFeature" | "TINRelief" | "RasterRelief" => SurfaceClass::Terrain,
        _ => return None,
    })
}

/// Converts a type name to a class name: `SolitaryVegetationObject` → `solitary_vegetation_object`.
pub fn to_class_name(type_name: &str) -> String {
    let mut class = String::with_capacity(type_name.len() + 4);
    let mut previous_lower = false;
    for c in type_name.chars() {
        if c.is_uppercase() && previous_lower {
            class.push('_');
        }
        previous_lower = c.is_lowercase() || c.is_ascii_digit();
        class.extend(c.to_lowercase());
    }
    class
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn class_names_are_snake_case() {
        for (type_name, class) in [("Building", "building"), ("BuildingPart", "building_part"), ("TINRelief", "tinrelief"), ("LandUse", "land_use")] {
            assert_eq!(to_class_name(type_name), class);
        }
    }

    #[test]
    fn ranks_follow_the_glossary() {
        for (type_name, parent, rank) in [
            ("Window", Rank::Other, Rank::Opening),
            ("Door", Rank::Installation, Rank::Opening),
            ("RoofSurface", Rank::Installation, Rank::Installation),
            ("RoofSurface", Rank::Other, Rank::Other),
            ("GroundSurface", Rank::Other, Rank::Ground),
            ("BuildingInstallation", Rank::Other, Rank::Installation),
            ("TrafficArea", Rank::Road, Rank::Road),
            ("TINRelief", Rank::Terrain, Rank::Terrain),
        ] {
            assert_eq!(rank_feature(classify_feature(type_name), type_name, parent), rank, "{type_name}");
        }
    }
}
