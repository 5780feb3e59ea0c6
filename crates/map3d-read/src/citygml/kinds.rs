//! What the elements of CityGML are to us.

use map3d_base::asset::Rank;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// An object with an id and attributes of its own.
    Object,
    /// An object that is a piece of the object above it.
    Part,
    /// A wall, a roof, ... of the object above it.
    Surface,
    /// A door or window.
    Opening,
    /// A balcony, chimney, dormer, ...
    Installation,
    /// Inside a building: not drawn.
    Interior,
    /// Not of CityGML: what it holds is looked through.
    Unknown,
}

pub fn kind_of(local: &str) -> Kind {
    match local {
        "BuildingPart" | "BridgePart" | "TunnelPart" => Kind::Part,
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
        | "Waterway" => Kind::Object,
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
        | "TINRelief"
        | "MassPointRelief"
        | "BreaklineRelief"
        | "RasterRelief" => Kind::Surface,
        "Window" | "Door" | "WindowSurface" | "DoorSurface" => Kind::Opening,
        "BuildingInstallation" | "BridgeInstallation" | "TunnelInstallation" | "BridgeConstructionElement" | "BuildingConstructiveElement" => {
            Kind::Installation
        }
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
        | "FloorSurface" => Kind::Interior,
        _ => Kind::Unknown,
    }
}

/// Class rank of the surfaces of an object.
pub fn rank_of_object(local: &str) -> Rank {
    match local {
        "Road" | "Railway" | "Track" | "Square" | "TransportationComplex" | "WaterBody" | "Waterway" => Rank::Road,
        "LandUse" | "ReliefFeature" => Rank::Terrain,
        _ => Rank::Other,
    }
}

/// Class rank of a feature below one of rank `above`.
pub fn rank_below(kind: Kind, local: &str, above: Rank) -> Rank {
    match kind {
        Kind::Object | Kind::Part => rank_of_object(local),
        Kind::Opening => Rank::Opening,
        Kind::Installation => Rank::Installation,
        Kind::Surface if local == "GroundSurface" && above == Rank::Other => Rank::Ground,
        Kind::Surface | Kind::Interior | Kind::Unknown => above,
    }
}

/// Colours (sRGB) of surfaces for which the document gives none.
pub fn default_color(local: &str) -> Option<(&'static str, [f32; 3])> {
    Some(match local {
        "RoofSurface" => ("default roof", [0.72, 0.42, 0.35]),
        "GroundSurface" => ("default ground", [0.6, 0.58, 0.55]),
        "Window" | "WindowSurface" => ("default window", [0.55, 0.66, 0.76]),
        "Door" | "DoorSurface" => ("default door", [0.5, 0.38, 0.28]),
        "Road" | "Square" | "Track" | "TransportationComplex" | "TrafficArea" | "Railway" => ("default road", [0.55, 0.55, 0.56]),
        "WaterBody" | "WaterSurface" | "Waterway" => ("default water", [0.45, 0.6, 0.75]),
        "PlantCover" | "SolitaryVegetationObject" | "AuxiliaryTrafficArea" => ("default vegetation", [0.42, 0.58, 0.35]),
        "LandUse" | "ReliefFeature" | "TINRelief" => ("default terrain", [0.66, 0.68, 0.58]),
        _ => return None,
    })
}

/// `SolitaryVegetationObject` → `solitary_vegetation_object`.
pub fn class_of(local: &str) -> String {
    let mut class = String::with_capacity(local.len() + 4);
    let mut previous_lower = false;
    for c in local.chars() {
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
    fn classes_are_words_in_lower_case() {
        for (local, class) in [("Building", "building"), ("BuildingPart", "building_part"), ("TINRelief", "tinrelief"), ("LandUse", "land_use")] {
            assert_eq!(class_of(local), class);
        }
    }

    #[test]
    fn ranks_follow_the_glossary() {
        for (local, above, rank) in [
            ("Window", Rank::Other, Rank::Opening),
            ("Door", Rank::Installation, Rank::Opening),
            ("RoofSurface", Rank::Installation, Rank::Installation),
            ("RoofSurface", Rank::Other, Rank::Other),
            ("GroundSurface", Rank::Other, Rank::Ground),
            ("BuildingInstallation", Rank::Other, Rank::Installation),
            ("TrafficArea", Rank::Road, Rank::Road),
            ("TINRelief", Rank::Terrain, Rank::Terrain),
        ] {
            assert_eq!(rank_below(kind_of(local), local, above), rank, "{local}");
        }
    }
}
