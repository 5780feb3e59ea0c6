//! CityGML constructs.

use crate::documents::city_model::{at_lod, building, member, model, multi_surface, polygon, read_text, ring, square, surface, try_text};
use crate::documents::of_format;
use map3d_base::asset::Rank;
use map3d_base::vec3::triangle_normal;
use serde_json::json;

#[test]
fn positions_are_read_in_every_notation() {
    let ring_of = |inner: &str| format!("<gml:Polygon><gml:exterior><gml:LinearRing>{inner}</gml:LinearRing></gml:exterior></gml:Polygon>");
    let pos = ["0 0 1", "2 0 1", "2 2 1", "0 2 1", "0 0 1"].map(|p| format!("<gml:pos>{p}</gml:pos>")).concat();
    let points = ["0 0 1", "2 0 1", "2 2 1", "0 2 1", "0 0 1"]
        .map(|p| format!("<gml:pointProperty><gml:Point><gml:pos>{p}</gml:pos></gml:Point></gml:pointProperty>"))
        .concat();
    let coord = ["0 0", "2 0", "2 2", "0 2", "0 0"]
        .map(|p| p.split_once(' ').expect("two"))
        .map(|(x, y)| format!("<gml:coord><gml:X>{x}</gml:X><gml:Y>{y}</gml:Y><gml:Z>1</gml:Z></gml:coord>"))
        .concat();
    for (case, inner) in [
        ("posList", "<gml:posList>0 0 1 2 0 1 2 2 1 0 2 1 0 0 1</gml:posList>".to_owned()),
        ("posList on several lines", "<gml:posList srsDimension=\"3\">\n0 0 1\r\n\t2 0 1 2 2 1\n0 2 1 0 0 1\n</gml:posList>".to_owned()),
        ("posList with a comment", "<gml:posList>0 0 1 2 0 1 <!-- here --> 2 2 1 0 2 1 0 0 1</gml:posList>".to_owned()),
        ("posList with two dimensions", "<gml:posList srsDimension=\"2\">0 0 2 0 2 2 0 2 0 0</gml:posList>".to_owned()),
        ("exponents", "<gml:posList>0 0 1e0 2.0 0 1 20e-1 2 1 0 +2 1 0 0 1</gml:posList>".to_owned()),
        ("pos", pos),
        ("pointProperty", points),
        ("coord", coord),
        ("coordinates", "<gml:coordinates>0,0,1 2,0,1 2,2,1 0,2,1 0,0,1</gml:coordinates>".to_owned()),
        (
            "coordinates with other separators",
            "<gml:coordinates decimal=\",\" cs=\";\" ts=\"|\">0;0;1|2,0;0;1|2;2;1|0;2;1|0;0;1</gml:coordinates>".to_owned(),
        ),
        ("repeated points", "<gml:posList>0 0 1 0 0 1 2 0 1 2 2 1 2 2 1 2 2 1 0 2 1 0 0 1 0 0 1</gml:posList>".to_owned()),
        ("cdata", "<gml:posList><![CDATA[0 0 1 2 0 1 2 2 1 0 2 1 0 0 1]]></gml:posList>".to_owned()),
        ("character references", "<gml:posList>0 0 1 2 0 1&#32;2 2 1 0 2 1 0 0 1</gml:posList>".to_owned()),
    ] {
        let document = read_text(&building(&at_lod(2, &ring_of(&inner))));
        assert_eq!((document.count(), document.area()), (2, 4.0), "{case}: {:?}", document.report);
        let is_flat = case == "posList with two dimensions";
        assert_eq!(
            (document.report.findings.len(), document.reported("polygon-without-height")),
            (usize::from(is_flat), u64::from(is_flat)),
            "{case}"
        );
    }
}

#[test]
fn open_rings_are_closed_with_a_warning() {
    let document = read_text(&building(&at_lod(2, &polygon("p", "0 0 0 2 0 0 2 2 0 0 2 0"))));
    assert_eq!((document.area(), document.reported("ring-not-closed")), (4.0, 1));
}

#[test]
fn holes_are_cut_out() {
    let hole = |points: &str| format!("<gml:interior>{}</gml:interior>", ring(points));
    let with = |holes: &str| {
        let exterior = ring("0 0 0 0 0 10 10 0 10 10 0 0 0 0 0");
        building(&at_lod(3, &format!("<gml:Polygon><gml:exterior>{exterior}</gml:exterior>{holes}</gml:Polygon>")))
    };
    let (one, two) = (hole("1 0 1 3 0 1 3 0 4 1 0 4 1 0 1"), hole("5 0 5 5 0 9 9 0 9 5 0 5"));
    for (holes, area) in [(String::new(), 100.0), (one.clone(), 94.0), (two.clone(), 92.0), (format!("{one}{two}"), 86.0)] {
        assert!((read_text(&with(&holes)).area() - area).abs() < 1e-9, "{area}");
    }
    let document = read_text(&with(&(hole("1 0 1 2 0 2 1 0 1") + &one)));
    assert_eq!((document.area(), document.reported("ring-with-too-few-points")), (94.0, 1), "a broken hole is skipped, the others stay");
}

#[test]
fn every_surface_and_solid_type_is_converted_once() {
    let (a, b) = (member(&square("a", 1)), member(&square("b", 2)));
    let composite = format!("<gml:CompositeSurface>{a}{b}</gml:CompositeSurface>");
    let solid = format!("<gml:Solid><gml:exterior>{composite}</gml:exterior></gml:Solid>");
    let triangle = "<gml:Triangle><gml:exterior><gml:LinearRing><gml:posList>0 0 0 4 0 0 0 4 0 0 0 0</gml:posList></gml:LinearRing></gml:exterior></gml:Triangle>";
    let patch = triangle.replace("Triangle", "PolygonPatch");
    for (case, geometry) in [
        ("CompositeSurface", composite.clone()),
        ("MultiSurface", multi_surface(&format!("{a}{b}"))),
        ("surfaceMembers", multi_surface(&format!("<gml:surfaceMembers>{}{}</gml:surfaceMembers>", square("a", 1), square("b", 2)))),
        ("nested", multi_surface(&member(&composite))),
        ("Solid", solid.clone()),
        ("MultiSolid", format!("<gml:MultiSolid><gml:solidMember>{solid}</gml:solidMember></gml:MultiSolid>")),
        ("CompositeSolid", format!("<gml:CompositeSolid><gml:solidMember>{solid}</gml:solidMember></gml:CompositeSolid>")),
        ("MultiGeometry", format!("<gml:MultiGeometry><gml:geometryMember>{composite}</gml:geometryMember></gml:MultiGeometry>")),
        (
            "OrientableSurface",
            format!("<gml:OrientableSurface orientation='-'><gml:baseSurface>{composite}</gml:baseSurface></gml:OrientableSurface>"),
        ),
        ("TriangulatedSurface", format!("<gml:TriangulatedSurface><gml:trianglePatches>{triangle}</gml:trianglePatches></gml:TriangulatedSurface>")),
        (
            "Tin",
            format!(
                "<gml:Tin><gml:trianglePatches>{triangle}</gml:trianglePatches><gml:controlPoint><gml:posList>1 2 3</gml:posList></gml:controlPoint></gml:Tin>"
            ),
        ),
        ("Surface", format!("<gml:Surface><gml:patches>{patch}</gml:patches></gml:Surface>")),
        ("PolyhedralSurface", format!("<gml:PolyhedralSurface><gml:polygonPatches>{patch}</gml:polygonPatches></gml:PolyhedralSurface>")),
    ] {
        let document = read_text(&building(&format!("<bldg:lod2Geometry>{geometry}</bldg:lod2Geometry>")));
        assert_eq!(document.area(), 8.0, "{case}: {:?}", document.report);
        assert!(document.report.findings.is_empty(), "{case}");
    }
}

#[test]
fn negative_orientation_reverses_a_surface() {
    let up = |geometry: &str| {
        let document = read_text(&building(&format!("<bldg:lod2Geometry>{geometry}</bldg:lod2Geometry>")));
        document.triangles().iter().map(|t| triangle_normal(t.corners)[2] / 2.0).sum::<f64>()
    };
    let oriented = |sign: &str, inner: &str| {
        format!("<gml:OrientableSurface orientation='{sign}'><gml:baseSurface>{inner}</gml:baseSurface></gml:OrientableSurface>")
    };
    assert_eq!(up(&square("a", 1)), 4.0);
    assert_eq!(up(&oriented("+", &square("a", 1))), 4.0);
    assert_eq!(up(&oriented("-", &square("a", 1))), -4.0);
    assert_eq!(up(&oriented("-", &oriented("-", &square("a", 1)))), 4.0);
}

#[test]
fn surfaces_have_the_class_rank_of_their_type() {
    let window = format!("<bldg:opening><bldg:Window>{}</bldg:Window></bldg:opening>", at_lod(3, &square("w", 9)));
    for (inner, rank) in [
        (surface("WallSurface", &at_lod(3, &square("p", 1))), Rank::Other),
        (surface("RoofSurface", &at_lod(3, &square("p", 1))), Rank::Other),
        (surface("OuterCeilingSurface", &at_lod(3, &square("p", 1))), Rank::Other),
        (surface("ClosureSurface", &at_lod(3, &square("p", 1))), Rank::Other),
        (surface("GroundSurface", &at_lod(3, &square("p", 1))), Rank::Ground),
        (surface("WallSurface", &window), Rank::Opening),
        (
            format!(
                "<bldg:outerBuildingInstallation><bldg:BuildingInstallation>{}</bldg:BuildingInstallation></bldg:outerBuildingInstallation>",
                surface("RoofSurface", &at_lod(3, &square("p", 1)))
            ),
            Rank::Installation,
        ),
        (at_lod(3, &square("p", 1)), Rank::Other),
    ] {
        let document = read_text(&building(&inner));
        assert!(document.triangles().iter().all(|t| t.rank == rank && t.object == 0), "{rank:?}");
        assert_eq!(document.count(), 2);
    }
}

#[test]
fn every_top_level_feature_type_is_converted() {
    for (element, rank, class) in [
        ("Road", Rank::Road, "road"),
        ("Railway", Rank::Road, "railway"),
        ("WaterBody", Rank::Road, "water_body"),
        ("LandUse", Rank::Terrain, "land_use"),
        ("Bridge", Rank::Other, "bridge"),
        ("Tunnel", Rank::Other, "tunnel"),
        ("CityFurniture", Rank::Other, "city_furniture"),
        ("PlantCover", Rank::Other, "plant_cover"),
        ("GenericCityObject", Rank::Other, "generic_city_object"),
        ("SomethingOfAnExtension", Rank::Other, "something_of_an_extension"),
        ("RoofSurface", Rank::Other, "roof_surface"),
        ("Window", Rank::Other, "window"),
        ("BuildingInstallation", Rank::Other, "building_installation"),
    ] {
        let text = model(&format!(
            "<core:cityObjectMember><x:{element} xmlns:x='y' gml:id='o'>{}</x:{element}></core:cityObjectMember>",
            at_lod(1, &square("p", 1))
        ));
        let document = read_text(&text);
        assert_eq!(document.count(), 2, "{element}");
        assert_eq!((document.objects[0].class.as_str(), document.triangles()[0].rank), (class, rank), "{element}");
    }
}

#[test]
fn top_level_rooms_are_objects_without_triangles() {
    let part = format!("<x><BuildingPart gml:id='p'>{}</BuildingPart></x>", at_lod(1, &square("q", 1)));
    let document =
        read_text(&model(&format!("<core:cityObjectMember><Room gml:id='r'>{}{part}</Room></core:cityObjectMember>", at_lod(1, &square("p", 1)))));
    let objects: Vec<_> = document.objects.iter().map(|o| (o.name.as_str(), o.parent)).collect();
    assert_eq!((objects, document.count()), (vec![("r", None), ("p", Some(0))], 0));
}

#[test]
fn relief_has_the_rank_of_terrain() {
    let tin = "<gml:TriangulatedSurface><gml:trianglePatches><gml:Triangle><gml:exterior><gml:LinearRing><gml:posList>0 0 0 4 0 0 0 4 0 0 0 0</gml:posList></gml:LinearRing></gml:exterior></gml:Triangle></gml:trianglePatches></gml:TriangulatedSurface>";
    let text = model(&format!(
        "<core:cityObjectMember><dem:ReliefFeature xmlns:dem='d' gml:id='r'><dem:lod>1</dem:lod><dem:reliefComponent><dem:TINRelief><dem:lod>1</dem:lod><dem:tin>{tin}</dem:tin></dem:TINRelief></dem:reliefComponent></dem:ReliefFeature></core:cityObjectMember>"
    ));
    let document = read_text(&text);
    assert_eq!((document.area(), document.triangles()[0].rank), (8.0, Rank::Terrain));
    assert_eq!((document.objects[0].class.as_str(), document.objects[0].lod.as_deref()), ("relief_feature", Some("1")));
}

#[test]
fn finest_level_of_detail_is_converted_unless_one_is_requested() {
    let body = at_lod(1, &square("one", 1)) + &surface("RoofSurface", &at_lod(2, &polygon("two", "0 0 0 1 0 0 0 1 0 0 0 0")));
    for (lod, area, converted) in [(None, 0.5, Some("2")), (Some("1"), 4.0, Some("1")), (Some("2"), 0.5, Some("2")), (Some("4"), 0.0, None)] {
        let options = of_format(json!({"lod": lod}));
        let document = try_text(&building(&body), &options).expect("readable");
        assert_eq!((document.area(), document.objects[0].lod.as_deref()), (area, converted), "{lod:?}");
    }
    let nonsense = of_format(json!({"lod": "high"}));
    assert!(matches!(try_text(&building(&body), &nonsense), Err(map3d_base::Error::Argument(_))));
}

#[test]
fn footprints_are_preferred_over_roof_edges() {
    let edge = format!("<bldg:lod0RoofEdge>{}</bldg:lod0RoofEdge>", multi_surface(&member(&square("e", 9))));
    let print = format!("<bldg:lod0FootPrint>{}</bldg:lod0FootPrint>", multi_surface(&member(&polygon("f", "0 0 0 1 0 0 0 1 0 0 0 0"))));
    assert_eq!(read_text(&building(&edge)).area(), 4.0);
    assert_eq!(read_text(&building(&(edge + &print))).area(), 0.5);
}

fn part(id: &str, inner: &str) -> String {
    format!("<bldg:consistsOfBuildingPart><bldg:BuildingPart gml:id='{id}'>{inner}</bldg:BuildingPart></bldg:consistsOfBuildingPart>")
}

#[test]
fn parts_are_objects_and_replace_a_coarser_building() {
    let parts = part("p1", &at_lod(2, &square("a", 1))) + &part("p2", &at_lod(1, &square("b", 2)));
    let document = read_text(&building(&format!("{}{parts}", at_lod(1, &square("whole", 0)))));
    assert_eq!(document.area(), 8.0, "the parts replace the building at LoD 1, each at its finest level");
    let objects: Vec<_> = document.objects.iter().map(|o| (o.name.as_str(), o.class.as_str(), o.parent)).collect();
    assert_eq!(objects, [("b1", "building", None), ("p1", "building_part", Some(0)), ("p2", "building_part", Some(0))]);
    assert_eq!(document.triangles().iter().map(|t| t.object).collect::<Vec<_>>(), [1, 1, 2, 2]);
    let equal = read_text(&building(&format!("{}{parts}", at_lod(2, &square("rest", 0)))));
    assert_eq!(equal.area(), 12.0, "a building as fine as its parts is converted too");
}

#[test]
fn installations_do_not_affect_the_level_of_the_walls() {
    let balcony = format!(
        "<bldg:outerBuildingInstallation><bldg:BuildingInstallation>{}</bldg:BuildingInstallation></bldg:outerBuildingInstallation>",
        at_lod(3, &square("balcony", 5))
    );
    assert_eq!(read_text(&building(&(at_lod(2, &square("wall", 1)) + &balcony))).area(), 8.0);
}

#[test]
fn rooms_are_skipped_except_openings_shared_with_the_outside() {
    let door = format!("<bldg:opening><bldg:Door gml:id='door'>{}</bldg:Door></bldg:opening>", at_lod(4, &square("d", 3)));
    let inner_wall =
        format!("<bldg:boundedBy><bldg:InteriorWallSurface>{}{door}</bldg:InteriorWallSurface></bldg:boundedBy>", at_lod(4, &square("i", 2)));
    let room = format!("<bldg:interiorRoom><bldg:Room>{inner_wall}</bldg:Room></bldg:interiorRoom>");
    let wall = surface("WallSurface", &at_lod(4, &polygon("w", "0 0 0 1 0 0 0 1 0 0 0 0")));
    assert_eq!(read_text(&building(&(wall.clone() + &room))).area(), 0.5);
    let sharing = surface("WallSurface", "<bldg:opening xlink:href='#door'/>");
    let referring = room.replace("<bldg:Room>", "<bldg:Room gml:id='room'>") + "<bldg:interiorRoom xlink:href='#room'/>";
    assert_eq!(read_text(&building(&(wall.clone() + &referring))).area(), 0.5, "a reference to a room does not expose it");
    let document = read_text(&building(&(wall + &room + &sharing)));
    assert_eq!(document.area(), 4.5);
    assert!(document.triangles().iter().any(|t| t.rank == Rank::Opening));
}

#[test]
fn shared_polygons_are_converted_once_with_the_rank_of_their_surface() {
    let link = |id: &str| format!("<gml:surfaceMember xlink:href=\"{id}\"/>");
    let solid = |links: &str| {
        format!(
            "<bldg:lod2Solid><gml:Solid><gml:exterior><gml:CompositeSurface>{links}</gml:CompositeSurface></gml:exterior></gml:Solid></bldg:lod2Solid>"
        )
    };
    let walls = surface("GroundSurface", &at_lod(2, &square("g", 0))) + &surface("WallSurface", &at_lod(2, &square("w", 1)));
    for links in [link("#g") + &link("#w"), link("g") + &link("w"), link("#g") + &link("#g") + &link("#w")] {
        for body in [solid(&links) + &walls, walls.clone() + &solid(&links)] {
            let document = read_text(&building(&body));
            assert_eq!((document.count(), document.area()), (4, 8.0));
            assert_eq!(document.triangles().iter().filter(|t| t.rank == Rank::Ground).count(), 2);
        }
    }
    let inline = solid(&(member(&square("g", 0)) + &member(&square("w", 1))));
    let referring = surface("GroundSurface", &format!("<bldg:lod2MultiSurface>{}</bldg:lod2MultiSurface>", multi_surface(&link("#g"))));
    let document = read_text(&building(&(inline + &referring)));
    assert_eq!((document.count(), document.triangles().iter().filter(|t| t.rank == Rank::Ground).count()), (4, 2));
}

#[test]
fn polygons_shared_between_objects_are_converted_once() {
    let other = |inner: &str| format!("<core:cityObjectMember><bldg:Building gml:id='b2'>{inner}</bldg:Building></core:cityObjectMember>");
    let owner = |inner: &str| format!("<core:cityObjectMember><bldg:Building gml:id='b1'>{inner}</bldg:Building></core:cityObjectMember>");
    let link = "<bldg:lod2MultiSurface><gml:MultiSurface><gml:surfaceMember xlink:href='#wall'/></gml:MultiSurface></bldg:lod2MultiSurface>";
    for text in [owner(&at_lod(2, &square("wall", 1))) + &other(link), other(link) + &owner(&at_lod(2, &square("wall", 1)))] {
        let document = read_text(&model(&text));
        assert_eq!((document.area(), document.reported("reference-unresolved")), (4.0, 0));
        assert_eq!(document.objects[document.triangles()[0].object as usize].name, "b1", "the owner converts it");
    }
    // The owner does not convert it, because it has a finer level of detail.
    let unconverted = owner(&(at_lod(1, &square("wall", 1)) + &at_lod(2, &polygon("x", "0 0 0 1 0 0 0 1 0 0 0 0"))));
    let document = read_text(&model(&(other(link) + &unconverted)));
    assert_eq!(document.area(), 4.5);
}

#[test]
fn attributes_are_read() {
    let document = read_text(&building(
        r#"<gml:description>a  house</gml:description><gml:name>Rathaus &amp; Keller</gml:name>
        <core:creationDate>2020-01-02</core:creationDate>
        <core:externalReference><core:informationSystem>http://sys</core:informationSystem><core:externalObject><core:name>X7</core:name></core:externalObject></core:externalReference>
        <gen:stringAttribute name="Code"><gen:value>007</gen:value></gen:stringAttribute>
        <gen:intAttribute name="count"><gen:value>7</gen:value></gen:intAttribute>
        <gen:doubleAttribute name="volume"><gen:value>1.5</gen:value></gen:doubleAttribute>
        <gen:measureAttribute name="area"><gen:value uom="m2">42</gen:value></gen:measureAttribute>
        <gen:dateAttribute name="day"><gen:value>2020-02-03</gen:value></gen:dateAttribute>
        <gen:uriAttribute name="link"><gen:value>http://a/b</gen:value></gen:uriAttribute>
        <gen:genericAttributeSet name="set"><gen:stringAttribute name="inner"><gen:value>v</gen:value></gen:stringAttribute></gen:genericAttributeSet>
        <bldg:class>1000</bldg:class><bldg:function>0100</bldg:function><bldg:function>0200</bldg:function><bldg:usage>1</bldg:usage>
        <bldg:yearOfConstruction>1985</bldg:yearOfConstruction><bldg:roofType>1030</bldg:roofType><bldg:measuredHeight uom="m">12.5</bldg:measuredHeight>
        <bldg:storeysAboveGround>3</bldg:storeysAboveGround>
        <bldg:address><core:Address><core:xalAddress><xAL:AddressDetails><xAL:Country><xAL:CountryName>Germany</xAL:CountryName><xAL:Locality Type="Town">
        <xAL:LocalityName>Town</xAL:LocalityName><xAL:Thoroughfare Type="Street"><xAL:ThoroughfareNumber>5</xAL:ThoroughfareNumber>
        <xAL:ThoroughfareName>Street</xAL:ThoroughfareName></xAL:Thoroughfare><xAL:PostalCode><xAL:PostalCodeNumber>12345</xAL:PostalCodeNumber></xAL:PostalCode>
        </xAL:Locality></xAL:Country></xAL:AddressDetails></core:xalAddress></core:Address></bldg:address>"#,
    ));
    let expected = json!({
        "description": "a  house", "name": "Rathaus & Keller", "creationDate": "2020-01-02", "externalReference": "http://sys X7",
        "Code": "007", "count": 7, "volume": 1.5, "area": 42, "day": "2020-02-03", "link": "http://a/b", "set/inner": "v",
        "class": "1000", "function": "0100, 0200", "usage": "1", "yearOfConstruction": 1985, "roofType": "gabled roof", "roofType/code": "1030", "measuredHeight": 12.5,
        "storeysAboveGround": 3, "address": "Street 5, 12345 Town",
    });
    assert_eq!(json!(document.objects[0].attributes), expected);
    assert_eq!(document.objects[0].name, "b1");
}

#[test]
fn generic_attributes_of_version_3_are_read() {
    let attribute = |kind: &str, name: &str, value: &str| {
        format!("<core:genericAttribute><gen:{kind}><gen:name>{name}</gen:name><gen:value>{value}</gen:value></gen:{kind}></core:genericAttribute>")
    };
    let document = read_text(&building(&(attribute("StringAttribute", "a", "007") + &attribute("DoubleAttribute", "b", "1.5"))));
    assert_eq!(json!(document.objects[0].attributes), json!({"a": "007", "b": 1.5}));
}

#[test]
fn objects_without_id_get_a_name() {
    let text =
        model("<core:cityObjectMember><bldg:Building/></core:cityObjectMember><core:cityObjectMember><bldg:Building/></core:cityObjectMember>");
    let names: Vec<String> = read_text(&text).objects.into_iter().map(|o| o.name).collect();
    assert_eq!(names, ["building-1", "building-2"]);
}

#[test]
fn coordinate_system_is_reported_as_written() {
    assert_eq!(read_text(&building("")).srs_name.as_deref(), Some("EPSG:25832+5783"));
    let on_geometry = "<CityModel><cityObjectMember><Building><lod1Solid><Solid srsName='urn:ogc:def:crs:EPSG:25832, crs:EPSG:5783'/></lod1Solid></Building></cityObjectMember></CityModel>";
    assert_eq!(read_text(on_geometry).srs_name.as_deref(), Some("urn:ogc:def:crs:EPSG:25832, crs:EPSG:5783"));
    assert_eq!(read_text("<CityModel/>").srs_name, None);
}

#[test]
fn polygons_in_degrees_are_triangulated_like_those_in_metres() {
    // A flat roof with millimetres of noise in z: without scaling, the best-fitting plane would be vertical.
    let points = "35.0000 139.0000 10.001 35.0000 139.0002 10.000 35.0001 139.0001 10.002 35.0002 139.0002 10.000 35.0002 139.0000 10.003 35.0000 139.0000 10.001";
    let text = building(&at_lod(2, &polygon("p", points))).replace("EPSG:25832+5783", "EPSG:6697");
    let document = read_text(&text);
    let flat: f64 = document.triangles().iter().map(|t| triangle_normal(t.corners)[2].abs() / 2.0).sum();
    assert!((flat - 3e-8).abs() < 1e-12, "{flat}");
}
