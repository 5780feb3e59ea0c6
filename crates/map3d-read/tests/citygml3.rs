//! Every theme of CityGML 3.0, with counts.

use crate::documents::city_model::{building, member, multi_surface, polygon, read_text, square};
use crate::documents::{Folder, ParsedDocument, read_with};
use map3d_base::Reason;
use map3d_base::asset::Rank;
use map3d_read::{CITYGML, ReadOptions};

fn model(body: &str) -> String {
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<CityModel xmlns="http://www.opengis.net/citygml/3.0" xmlns:gml="http://www.opengis.net/gml/3.2" xmlns:xlink="http://www.w3.org/1999/xlink"
 xmlns:con="http://www.opengis.net/citygml/construction/3.0" xmlns:tran="http://www.opengis.net/citygml/transportation/3.0"><gml:boundedBy>
<gml:Envelope srsName="EPSG:25832" srsDimension="3"/></gml:boundedBy>{body}</CityModel>"#
    )
}

fn object(element: &str, inner: &str) -> String {
    format!("<cityObjectMember><x:{element} xmlns:x='y' gml:id='o'>{inner}</x:{element}></cityObjectMember>")
}

fn at(lod: u32, id: &str, z: u32) -> String {
    format!("<lod{lod}MultiSurface>{}</lod{lod}MultiSurface>", multi_surface(&member(&square(id, z))))
}

fn boundary(element: &str, inner: &str) -> String {
    format!("<boundary><x:{element} xmlns:x='y'>{inner}</x:{element}></boundary>")
}

fn solid(lod: u32, id: &str) -> String {
    format!("<lod{lod}Solid><gml:Solid><gml:exterior><gml:Shell>{}</gml:Shell></gml:exterior></gml:Solid></lod{lod}Solid>", member(&square(id, 9)))
}

/// Returns triangles, class of the object, rank of the first triangle.
fn outcome(text: &str) -> (usize, String, Option<Rank>) {
    let document = read_text(text);
    assert!(document.report.findings.iter().all(|f| f.message.reason == Reason::SolidOfOpenSpace), "{:?}", document.report.findings);
    (document.count(), document.objects[0].class.clone(), document.triangles().first().map(|t| t.rank))
}

#[test]
fn every_theme_is_read() {
    let patch = |id: &str| square(id, 1).replace("gml:Polygon", "gml:PolygonPatch");
    let surface = format!(
        "<lod2MultiSurface>{}</lod2MultiSurface>",
        multi_surface(&member(&format!("<gml:Surface gml:id='s'><gml:patches>{}</gml:patches></gml:Surface>", patch("p"))))
    );
    let window = |kind: &str| format!("<con:fillingSurface><con:{kind}>{}</con:{kind}></con:fillingSurface>", at(3, kind, 3));
    let tin = "<d:reliefComponent xmlns:d='d'><d:TINRelief><d:lod>1</d:lod><d:tin><gml:TriangulatedSurface><gml:patches><gml:Triangle><gml:exterior><gml:LinearRing><gml:posList>0 0 0 4 0 0 0 4 0 0 0 0</gml:posList></gml:LinearRing></gml:exterior></gml:Triangle></gml:patches></gml:TriangulatedSurface></d:tin></d:TINRelief></d:reliefComponent>";
    let section = |inner: &str| format!("<tran:section><tran:Section>{inner}</tran:Section></tran:section>");
    let space = |kind: &str, inner: &str| format!("<tran:trafficSpace><tran:{kind}>{inner}</tran:{kind}></tran:trafficSpace>");
    let road = section(
        &(space("TrafficSpace", &(boundary("TrafficArea", &at(2, "a", 0)) + &solid(1, "air")))
            + &space("AuxiliaryTrafficSpace", &boundary("AuxiliaryTrafficArea", &at(2, "b", 0)))),
    );
    for (element, inner, triangles, class, rank) in [
        ("Building", boundary("RoofSurface", &surface), 2, "building", Rank::Other),
        ("Building", boundary("GroundSurface", &at(2, "g", 0)) + &boundary("WallSurface", &at(2, "w", 1)), 4, "building", Rank::Ground),
        ("Building", boundary("WallSurface", &(at(3, "w", 1) + &window("WindowSurface") + &window("DoorSurface"))), 6, "building", Rank::Other),
        ("Building", format!("<x:buildingPart><x:BuildingPart>{}</x:BuildingPart></x:buildingPart>", at(2, "p", 1)), 2, "building", Rank::Other),
        (
            "Building",
            format!("<x:buildingInstallation><x:BuildingInstallation>{}</x:BuildingInstallation></x:buildingInstallation>", at(2, "i", 1)),
            2,
            "building",
            Rank::Installation,
        ),
        (
            "Building",
            format!(
                "<x:buildingConstructiveElement><x:BuildingConstructiveElement>{}</x:BuildingConstructiveElement></x:buildingConstructiveElement>",
                at(2, "i", 1)
            ),
            2,
            "building",
            Rank::Installation,
        ),
        ("Building", format!("<con:filling><con:Window>{}</con:Window></con:filling>", at(3, "i", 1)), 2, "building", Rank::Opening),
        (
            "Bridge",
            format!(
                "<x:bridgeConstructiveElement><x:BridgeConstructiveElement>{}</x:BridgeConstructiveElement></x:bridgeConstructiveElement>",
                at(2, "i", 1)
            ),
            2,
            "bridge",
            Rank::Installation,
        ),
        ("Tunnel", format!("<x:tunnelPart><x:TunnelPart>{}</x:TunnelPart></x:tunnelPart>", at(2, "t", 1)), 2, "tunnel", Rank::Other),
        ("OtherConstruction", boundary("WallSurface", &at(2, "w", 1)), 2, "other_construction", Rank::Other),
        ("Road", road, 4, "road", Rank::Road),
        ("Square", section(&at(1, "s", 0)), 2, "square", Rank::Road),
        (
            "Railway",
            section(&format!("<tran:intersection><tran:Intersection>{}</tran:Intersection></tran:intersection>", at(2, "r", 0))),
            2,
            "railway",
            Rank::Road,
        ),
        ("Waterway", space("TrafficSpace", &at(2, "w", 0)), 2, "waterway", Rank::Road),
        ("Road", boundary("Marking", &at(2, "m", 0)), 2, "road", Rank::Road),
        ("Road", format!("<tran:hole><tran:Hole>{}</tran:Hole></tran:hole>", boundary("HoleSurface", &at(2, "h", 0))), 2, "road", Rank::Road),
        ("WaterBody", boundary("WaterSurface", &at(2, "w", 0)) + &boundary("WaterGroundSurface", &at(2, "g", 1)), 4, "water_body", Rank::Road),
        ("LandUse", at(1, "l", 0), 2, "land_use", Rank::Terrain),
        ("PlantCover", solid(1, "p"), 2, "plant_cover", Rank::Other),
        ("SolitaryVegetationObject", at(2, "v", 0), 2, "solitary_vegetation_object", Rank::Other),
        ("CityFurniture", at(3, "f", 0), 2, "city_furniture", Rank::Other),
        ("ReliefFeature", tin.into(), 1, "relief_feature", Rank::Terrain),
        ("GenericOccupiedSpace", at(0, "g", 0), 2, "generic_occupied_space", Rank::Other),
        ("GenericLogicalSpace", boundary("GenericThematicSurface", &at(2, "g", 0)), 2, "generic_logical_space", Rank::Other),
        ("GenericThematicSurface", at(2, "g", 0), 2, "generic_thematic_surface", Rank::Other),
    ] {
        let (found, found_class, found_rank) = outcome(&model(&object(element, &inner)));
        assert_eq!((found, found_class.as_str(), found_rank), (triangles, class, Some(rank)), "{element}: {inner}");
    }
}

#[test]
fn open_spaces_have_no_solid() {
    let clearance = format!("<tran:clearanceSpace><tran:ClearanceSpace>{}</tran:ClearanceSpace></tran:clearanceSpace>", solid(2, "c"));
    let space = format!(
        "<tran:trafficSpace><tran:TrafficSpace>{}{}{clearance}</tran:TrafficSpace></tran:trafficSpace>",
        solid(2, "t"),
        boundary("TrafficArea", &at(2, "a", 0))
    );
    let document = read_text(&model(&object("Road", &space)));
    assert_eq!((document.count(), document.reported("solid-of-open-space")), (2, 2));
}

#[test]
fn versions_groups_and_sensors_are_left_alone() {
    let group = "<cityObjectMember><g:CityObjectGroup xmlns:g='g' gml:id='g'><g:groupMember><g:Role><g:groupMember xlink:href='#o'/></g:Role></g:groupMember></g:CityObjectGroup></cityObjectMember>";
    let version = "<versionMember><v:Version xmlns:v='v'><v:versionMember xlink:href='#o'/></v:Version></versionMember>";
    let sensor = "<dynamizer><d:Dynamizer xmlns:d='d'><d:attributeRef>//x</d:attributeRef><d:startTime>1</d:startTime></d:Dynamizer></dynamizer>";
    let cloud = "<pointCloud><p:PointCloud xmlns:p='p'><p:pointFile>a.laz</p:pointFile></p:PointCloud></pointCloud>";
    let document = read_text(&model(&(object("Building", &(at(2, "w", 1) + sensor + cloud)) + group + version)));
    assert_eq!((document.count(), document.objects.len(), document.objects[0].attributes.len()), (2, 2, 0));
}

#[test]
fn prototypes_may_contain_their_appearance() {
    let implicit = "<lod2ImplicitRepresentation><ImplicitGeometry><referencePoint><gml:Point><gml:pos>5 6 7</gml:pos></gml:Point></referencePoint>
        <relativeGeometry><gml:MultiSurface gml:id='m'><gml:surfaceMember><gml:Polygon gml:id='p'><gml:exterior><gml:LinearRing><gml:posList>0 0 0 1 0 0 0 1 0 0 0 0</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember></gml:MultiSurface></relativeGeometry>
        <appearance><app:Appearance xmlns:app='a'><app:surfaceData><app:X3DMaterial><app:diffuseColor>1 0 0</app:diffuseColor><app:target>#m</app:target></app:X3DMaterial></app:surfaceData></app:Appearance></appearance>
        </ImplicitGeometry></lod2ImplicitRepresentation>";
    let document = read_text(&model(&object("CityFurniture", implicit)));
    assert_eq!((document.count(), document.instances.len(), document.material_of(0).diffuse), (1, 1, [1.0, 0.0, 0.0, 1.0]));
}

#[test]
fn geometry_without_a_level_of_detail_is_drawn_if_there_is_no_other() {
    let plain = format!("<ade:volumeGeometry>{}</ade:volumeGeometry>", multi_surface(&member(&square("v", 5))));
    let document = read_text(&building(&plain));
    assert_eq!((document.area(), document.reported("geometry-without-lod")), (4.0, 1));
    let half = multi_surface(&member(&polygon("h", "0 0 0 1 0 0 0 1 0 0 0 0")));
    assert_eq!(read_text(&building(&format!("<bldg:lod1MultiSurface>{half}</bldg:lod1MultiSurface>{plain}"))).area(), 0.5);
    let group = model(&object("CityObjectGroup", &plain));
    assert_eq!(read_text(&group).count(), 0, "the geometry of a group is that of its members");
}

/// Reads a building of CityGML 1.0 or 0.4 with a textured surface.
fn read_textured(namespace: &str, orientation: &str, appearance: &str, polygon: &str) -> ParsedDocument {
    let folder = Folder::new("textured");
    folder.put_png("t.png", 4, 4, [9, 8, 7, 255]);
    let text = format!(
        "<CityModel xmlns='{namespace}' xmlns:tex='{namespace}' xmlns:gml='http://www.opengis.net/gml'><cityObjectMember><Building gml:id='b'><lod2Solid><gml:Solid><gml:exterior><gml:CompositeSurface>
        <gml:surfaceMember><tex:TexturedSurface orientation='+'><gml:baseSurface>{polygon}</gml:baseSurface><tex:appearance orientation='{orientation}'>{appearance}</tex:appearance></tex:TexturedSurface></gml:surfaceMember>
        <gml:surfaceMember><gml:Polygon><gml:exterior><gml:LinearRing><gml:posList>0 0 5 1 0 5 0 1 5 0 0 5</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember>
        </gml:CompositeSurface></gml:exterior></gml:Solid></lod2Solid></Building></cityObjectMember></CityModel>"
    );
    read_with(&folder.put("a.gml", text), &CITYGML, &ReadOptions::default()).expect("readable")
}

#[test]
fn textured_surfaces_of_old_versions_have_their_material_or_texture() {
    let triangle =
        "<gml:Polygon><gml:exterior><gml:LinearRing><gml:posList>0 0 0 1 0 0 0 1 0 0 0 0</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon>";
    let texture = |uvs: &str| {
        format!(
            "<tex:SimpleTexture><tex:textureMap>t.png</tex:textureMap><tex:textureCoordinates>{uvs}</tex:textureCoordinates><tex:textureType>specific</tex:textureType><tex:repeat>1</tex:repeat></tex:SimpleTexture>"
        )
    };
    for namespace in ["http://www.opengis.net/citygml/texturedsurface/1.0", "http://www.citygml.org/citygml/1/0/0"] {
        for uvs in ["0 0 0.5 0 0 1 0 0", "0 0 0.5 0 0 1"] {
            let document = read_textured(namespace, "+", &texture(uvs), triangle);
            assert_eq!((document.count(), document.textures.len()), (2, 1));
            assert!(document.material_of(0).texture.is_some() && document.material_of(1).texture.is_none());
            assert_eq!(document.triangles()[0].uvs, Some([[0.0, 0.0], [0.5, 0.0], [0.0, 1.0]]), "{uvs}");
        }
        let material = "<tex:Material><tex:transparency>0.25</tex:transparency><tex:diffuseColor>1 0 0</tex:diffuseColor></tex:Material>";
        for orientation in ["+", "-"] {
            let document = read_textured(namespace, orientation, material, triangle);
            assert_eq!((document.material_of(0).diffuse, document.material_of(1).diffuse[3]), ([1.0, 0.0, 0.0, 0.75], 1.0));
        }
    }
}

#[test]
fn texture_coordinates_of_textured_surfaces_cover_all_rings() {
    let ring = |points: &str| format!("<gml:LinearRing><gml:posList>{points}</gml:posList></gml:LinearRing>");
    let polygon = format!(
        "<gml:Polygon><gml:exterior>{}</gml:exterior><gml:interior>{}</gml:interior></gml:Polygon>",
        ring("0 0 0 4 0 0 4 4 0 0 4 0 0 0 0"),
        ring("1 1 0 1 2 0 2 2 0 2 1 0 1 1 0")
    );
    let closed = "0 0 1 0 1 1 0 1 0 0 .25 .25 .25 .5 .5 .5 .5 .25 .25 .25";
    let open = "0 0 1 0 1 1 0 1 .25 .25 .25 .5 .5 .5 .5 .25";
    for uvs in [closed, open] {
        let appearance = format!("<SimpleTexture><textureMap>t.png</textureMap><textureCoordinates>{uvs}</textureCoordinates></SimpleTexture>");
        let document = read_textured("x", "+", &appearance, &polygon);
        for triangle in document.triangles().iter().filter(|t| document.materials[t.material as usize].texture.is_some()) {
            let uvs = triangle.uvs.expect("textured");
            assert!((0..3).all(|k| uvs[k] == [triangle.corners[k][0] as f32 / 4.0, triangle.corners[k][1] as f32 / 4.0]), "{triangle:?}");
        }
        assert_eq!(document.count(), 9);
    }
    for broken in ["0 0 1", "a b", "0 0"] {
        let appearance = format!("<SimpleTexture><textureMap>t.png</textureMap><textureCoordinates>{broken}</textureCoordinates></SimpleTexture>");
        assert_eq!(read_textured("x", "+", &appearance, &polygon).count(), 9, "drawn without texture");
    }
}
