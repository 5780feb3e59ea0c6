//! Attributes of CityGML objects: extensions (ADE), code lists, addresses, references, heights.

use crate::documents::city_model::{at_lod, building, member, multi_surface, read_text, square, surface};
use crate::documents::{Folder, ParsedDocument, read_with};
use map3d_read::{CITYGML, ReadOptions};
use serde_json::{Value, json};

fn attributes(document: &ParsedDocument) -> Value {
    json!(document.objects[0].attributes)
}

fn attributes_of(body: &str) -> Value {
    attributes(&read_text(&building(body)))
}

#[test]
fn attributes_of_extensions_are_named_after_their_path() {
    let body = r#"
        <uro:buildingIDAttribute><uro:BuildingIDAttribute><uro:buildingID>14201-bldg-110968</uro:buildingID><uro:branchID>1</uro:branchID>
        </uro:BuildingIDAttribute></uro:buildingIDAttribute>
        <uro:buildingDetailAttribute><uro:BuildingDetailAttribute><uro:totalFloorArea uom="m2">42.5</uro:totalFloorArea>
        <uro:surveyYear>2016</uro:surveyYear></uro:BuildingDetailAttribute></uro:buildingDetailAttribute>
        <uro:buildingDisasterRiskAttribute><uro:BuildingTsunamiRiskAttribute><uro:depth uom="m">0.7</uro:depth></uro:BuildingTsunamiRiskAttribute>
        </uro:buildingDisasterRiskAttribute>
        <ade:owner>Smith</ade:owner><ade:owner>Jones</ade:owner><ade:area uom="m2">50</ade:area>
        <ade:unit><ade:BuildingUnitType><ade:equippedWith><ade:Heating><ade:power uom="W">4000</ade:power></ade:Heating></ade:equippedWith>
        </ade:BuildingUnitType></ade:unit>
        <ade:plain><ade:a>1</ade:a><ade:b><ade:c>x</ade:c></ade:b></ade:plain>"#;
    let document = read_text(&building(body));
    assert_eq!(
        attributes(&document),
        json!({
            "buildingIDAttribute/buildingID": "14201-bldg-110968", "buildingIDAttribute/branchID": "1",
            "buildingDetailAttribute/totalFloorArea": 42.5, "buildingDetailAttribute/surveyYear": "2016",
            "buildingDisasterRiskAttribute/BuildingTsunamiRiskAttribute/depth": 0.7,
            "owner": "Smith, Jones", "area": 50, "unit/equippedWith/Heating/power": 4000, "unit/equippedWith/Heating/power/unit": "W",
            "plain/a": "1", "plain/b/c": "x",
        })
    );
    assert_eq!(document.reported("element-unknown"), 0, "nothing is drawn in them");
}

#[test]
fn repeated_data_types_are_numbered_and_pairs_are_named_after_their_key() {
    let noise = |day: u32| format!("<n:segmentProperty><n:Segment><n:mDay uom='1/h'>{day}</n:mDay></n:Segment></n:segmentProperty>");
    let pair = |key: &str, value: &str| {
        format!("<u:keyValuePairAttribute><u:KeyValuePairAttribute><u:key>{key}</u:key>{value}</u:KeyValuePairAttribute></u:keyValuePairAttribute>")
    };
    let pairs = pair("104", "<u:codeValue>1</u:codeValue>") + &pair("105", "<u:measuredValue uom='m'>2.5</u:measuredValue>");
    assert_eq!(
        attributes_of(&(noise(5) + &noise(7) + &noise(5) + &pairs)),
        json!({
            "segmentProperty/mDay": 5, "segmentProperty/mDay/unit": "1/h", "segmentProperty[2]/mDay": 7, "segmentProperty[2]/mDay/unit": "1/h", "segmentProperty[3]/mDay": 5, "segmentProperty[3]/mDay/unit": "1/h",
            "keyValuePairAttribute/104": "1", "keyValuePairAttribute/105": 2.5,
        })
    );
    let many: String = (0..150).map(noise).collect();
    assert_eq!(attributes_of(&many).as_object().map(|a| a.len()), Some(200), "the first hundred, with their units");
}

#[test]
fn geometry_and_features_in_an_extension_are_drawn_and_its_attributes_read() {
    let body = format!(
        "<ade:facade><ade:Facade><ade:material>brick</ade:material>{}</ade:Facade></ade:facade>{}",
        at_lod(2, &square("f", 1)),
        surface("WallSurface", &format!("<ade:colour>red</ade:colour><ade:x><ade:y>1</ade:y></ade:x>{}", at_lod(2, &square("w", 2)))),
    );
    let document = read_text(&building(&body));
    assert_eq!(document.area(), 8.0);
    assert_eq!(attributes(&document), json!({"facade/material": "brick"}), "attributes of surfaces are not kept");
    assert_eq!(document.reported("element-unknown"), 1);
}

fn dictionary(definitions: &str) -> String {
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?><gml:Dictionary xmlns:gml="http://www.opengis.net/gml" gml:id="d"><gml:name>List</gml:name>{definitions}</gml:Dictionary>"#
    )
}

fn definition(inner: &str) -> String {
    format!("<gml:dictionaryEntry><gml:Definition gml:id='x'>{inner}</gml:Definition></gml:dictionaryEntry>")
}

/// Reads `udx/town.gml` of a folder with code lists.
fn read_in(folder: &Folder, body: &str, options: &ReadOptions) -> ParsedDocument {
    let path = folder.put("udx/town.gml", building(body));
    read_with(&path, &CITYGML, options).expect("readable")
}

#[test]
fn code_lists_in_the_folder_give_codes_their_names() {
    let folder = Folder::new("lists");
    let usage = [("401", "office"), ("411", "house")]
        .map(|(code, label)| definition(&format!("<gml:description>{label}</gml:description><gml:name>{code}</gml:name>")));
    folder.put("codelists/Building_usage.xml", dictionary(&usage.concat()));
    let roof = definition("<gml:description/><gml:name>gabled</gml:name><gml:name codeSpace='urn:x'>2</gml:name>");
    let identified = definition("<gml:identifier codeSpace='http://x'>http://x/roof/hip</gml:identifier><gml:name>hipped</gml:name>");
    folder.put("codelists/roofs.xml", dictionary(&(roof + &identified)));
    let options = ReadOptions { folder: Some(folder.0.clone()), strict: true, ..ReadOptions::default() };
    let body = r#"
        <gen:stringAttribute name="n"><gen:value>v</gen:value></gen:stringAttribute>
        <bldg:usage codeSpace="../codelists/Building_usage.xml">411</bldg:usage>
        <bldg:function codeSpace="..\codelists\Building_usage.xml">401</bldg:function><bldg:function codeSpace="../codelists/Building_usage.xml">411</bldg:function>
        <bldg:roofType codeSpace="../codelists/roofs.xml">2</bldg:roofType>
        <u:detail><u:Detail><u:other codeSpace="../codelists/roofs.xml">hip</u:other><u:none codeSpace="../codelists/roofs.xml">9</u:none></u:Detail></u:detail>
        <core:genericAttribute><gen:CodeAttribute><gen:name>kind</gen:name><gen:value codeSpace="../codelists/roofs.xml">2</gen:value></gen:CodeAttribute></core:genericAttribute>"#;
    assert_eq!(
        attributes(&read_in(&folder, body, &options)),
        json!({
            "n": "v", "usage": "house", "usage/code": "411", "function": "office, house", "function/code": "401, 411",
            "roofType": "gabled", "roofType/code": "2", "detail/other": "hipped", "detail/other/code": "hip", "detail/none": "9",
            "kind": "gabled", "kind/code": "2",
        })
    );
}

#[test]
fn code_lists_outside_the_folder_or_broken_leave_the_codes() {
    let folder = Folder::new("lists");
    folder.put("secret.xml", dictionary(&definition("<gml:description>secret</gml:description><gml:name>1</gml:name>")));
    folder.put("udx/cut.xml", "<gml:Dictionary><gml:dictionaryEntry>");
    folder.put("udx/other.xml", "<html/>");
    folder.put("udx/doctype.xml", "<!DOCTYPE a [<!ENTITY b SYSTEM 'file:///etc/passwd'>]><Dictionary>&b;</Dictionary>");
    std::os::unix::fs::symlink(folder.0.join("secret.xml"), folder.0.join("udx/link.xml")).expect("a link");
    let absolute = folder.0.join("secret.xml").display().to_string();
    let spaces =
        ["../secret.xml", "link.xml", &absolute, "cut.xml", "other.xml", "doctype.xml", "gone.xml", "http://example.org/a.xml", "XYZ", "urn:a:b"];
    let body: String = spaces.iter().enumerate().map(|(k, space)| format!("<u:p{k} codeSpace='{space}'>1</u:p{k}>").repeat(2)).collect();
    let document = read_in(&folder, &body, &ReadOptions::default());
    let values = attributes(&document);
    assert!((0..spaces.len()).all(|k| values[format!("p{k}")] == "1"), "{values}");
    assert!(!values.to_string().contains("secret"), "{values}");
    assert_eq!(document.reported("code-list-not-read"), 7, "one for each file, none for other names: {:?}", document.report.findings);
}

#[test]
fn codes_of_public_standards_are_decoded_without_a_list() {
    assert_eq!(
        attributes_of("<bldg:function>31001_1010</bldg:function><bldg:roofType>1000</bldg:roofType>"),
        json!({"function": "Wohnhaus", "function/code": "31001_1010", "roofType": "Flachdach", "roofType/code": "1000"})
    );
    let sig3d = |name: &str| format!("http://www.sig3d.org/codelists/standard/building/2.0/_AbstractBuilding_{name}.xml");
    let body = format!(
        "<bldg:function codeSpace='{}'>1000</bldg:function><bldg:roofType codeSpace='{}'>1030</bldg:roofType><bldg:usage>1000</bldg:usage>",
        sig3d("function"),
        sig3d("roofType")
    );
    assert_eq!(
        attributes_of(&body),
        json!({"function": "residential building", "function/code": "1000", "roofType": "gabled roof", "roofType/code": "1030", "usage": "1000"})
    );
    let document = read_text(&building("<bldg:usage codeSpace='../../codelists/Building_usage.xml'>422</bldg:usage>"));
    assert_eq!(attributes(&document), json!({"usage": "文教厚生施設", "usage/code": "422"}));
}

#[test]
fn addresses_of_both_versions_of_xal_are_one_line() {
    let address = |inner: &str| format!("<bldg:address><core:Address><core:xalAddress>{inner}</core:xalAddress></core:Address></bldg:address>");
    let structured = r#"<xAL:Address><xAL:Country><xAL:NameElement>France</xAL:NameElement></xAL:Country>
        <xAL:AdministrativeArea><xAL:NameElement>Rhône</xAL:NameElement></xAL:AdministrativeArea>
        <xAL:Locality><xAL:NameElement>Lyon</xAL:NameElement><xAL:SubLocality><xAL:NameElement>Presqu'île</xAL:NameElement></xAL:SubLocality></xAL:Locality>
        <xAL:Thoroughfare><xAL:NameElement xAL:NameType="ReferenceLocation">Opéra</xAL:NameElement><xAL:Number>1</xAL:Number>
        <xAL:NameElement xAL:NameType="NameOnly">Place de la Comédie</xAL:NameElement></xAL:Thoroughfare>
        <xAL:PostCode><xAL:Identifier>69001</xAL:Identifier></xAL:PostCode></xAL:Address>"#;
    let german = r#"<xAL:Address><xAL:Locality><xAL:NameElement>Karlsruhe</xAL:NameElement></xAL:Locality>
        <xAL:Thoroughfare><xAL:NameElement>Spöcker Str.</xAL:NameElement><xAL:Number>5</xAL:Number></xAL:Thoroughfare>
        <xAL:PostCode><xAL:Identifier>76131</xAL:Identifier></xAL:PostCode></xAL:Address>"#;
    let free = "<xAL:Address><xAL:FreeTextAddress><xAL:AddressLine>1 Place X</xAL:AddressLine><xAL:AddressLine>69001 Lyon</xAL:AddressLine></xAL:FreeTextAddress></xAL:Address>";
    let two = r#"<xAL:AddressDetails><xAL:Country><xAL:CountryName>Germany</xAL:CountryName><xAL:Locality Type="Town"><xAL:LocalityName>Town</xAL:LocalityName>
        <xAL:Thoroughfare Type="Street"><xAL:ThoroughfareNumber>5</xAL:ThoroughfareNumber><xAL:ThoroughfareNumberSuffix>a</xAL:ThoroughfareNumberSuffix>
        <xAL:ThoroughfareName>Street</xAL:ThoroughfareName></xAL:Thoroughfare><xAL:PostalCode><xAL:PostalCodeNumber>12345</xAL:PostalCodeNumber></xAL:PostalCode>
        </xAL:Locality></xAL:Country></xAL:AddressDetails>"#;
    for (inner, expected) in [
        (structured, "Opéra, 1 Place de la Comédie, 69001 Lyon"),
        (german, "Spöcker Str. 5, 76131 Karlsruhe"),
        (free, "1 Place X, 69001 Lyon"),
        (two, "Street 5a, 12345 Town"),
    ] {
        assert_eq!(attributes_of(&address(inner)), json!({ "address": expected }));
    }
    assert_eq!(attributes_of(&address("<xAL:Address/>")), json!({}));
}

#[test]
fn external_references_of_all_versions_have_their_system_and_object() {
    let reference = |inner: &str| format!("<core:externalReference>{inner}</core:externalReference>");
    let system = "<core:informationSystem>http://sys</core:informationSystem>";
    for (inner, expected) in [
        (format!("{system}<core:externalObject><core:name>X7</core:name></core:externalObject>"), "http://sys X7"),
        (format!("{system}<core:externalObject><core:uri>http://sys/X7</core:uri></core:externalObject>"), "http://sys http://sys/X7"),
        (
            format!(
                "<core:ExternalReference><core:targetResource>X7</core:targetResource>{system}<core:relationType>r</core:relationType></core:ExternalReference>"
            ),
            "http://sys X7",
        ),
        ("<core:ExternalReference><core:targetResource>X7</core:targetResource></core:ExternalReference>".into(), "X7"),
    ] {
        assert_eq!(attributes_of(&reference(&inner)), json!({ "externalReference": expected }));
    }
    let two = reference("<core:externalObject><core:name>A</core:name></core:externalObject>")
        + &reference("<core:externalObject><core:name>B</core:name></core:externalObject>");
    assert_eq!(attributes_of(&two), json!({"externalReference": "A, B"}));
}

#[test]
fn heights_and_areas_of_version_3_have_their_value_and_what_it_means() {
    let height = |value: &str| {
        format!(
            "<con:height><con:Height><con:highReference>highestRoofEdge</con:highReference><con:lowReference>lowestGroundPoint</con:lowReference>
             <con:status>measured</con:status><con:value uom='m'>{value}</con:value></con:Height></con:height>"
        )
    };
    let area =
        "<core:area><core:QualifiedArea><core:typeOfArea>net</core:typeOfArea><core:area uom='m2'>120</core:area></core:QualifiedArea></core:area>";
    assert_eq!(
        attributes_of(&(height("5.43") + &height("7.5") + area)),
        json!({
            "height": 5.43, "height/highReference": "highestRoofEdge", "height/lowReference": "lowestGroundPoint", "height/status": "measured",
            "height[2]": 7.5, "height[2]/highReference": "highestRoofEdge", "height[2]/lowReference": "lowestGroundPoint",
            "height[2]/status": "measured", "area": 120, "area/typeOfArea": "net",
        })
    );
}

#[test]
fn sets_of_generic_attributes_of_version_3_are_read() {
    let attribute = |name: &str| {
        format!(
            "<core:genericAttribute><gen:IntAttribute><gen:name>{name}</gen:name><gen:value>7</gen:value></gen:IntAttribute></core:genericAttribute>"
        )
    };
    let set = attribute("a").replace("core:genericAttribute", "gen:genericAttribute");
    let body =
        format!("<core:genericAttribute><gen:GenericAttributeSet><gen:name>set</gen:name>{set}</gen:GenericAttributeSet></core:genericAttribute>");
    assert_eq!(attributes_of(&(attribute("b") + &body)), json!({"b": 7, "set/a": 7}));
}

#[test]
fn parts_have_their_own_attributes() {
    let part = format!(
        "<bldg:consistsOfBuildingPart><bldg:BuildingPart gml:id='p'><u:d><u:D><u:x>1</u:x></u:D></u:d><bldg:lod1MultiSurface>{}</bldg:lod1MultiSurface>
         </bldg:BuildingPart></bldg:consistsOfBuildingPart>",
        multi_surface(&member(&square("a", 1)))
    );
    let document = read_text(&building(&(part + "<u:d><u:D><u:x>2</u:x></u:D></u:d>")));
    let found: Vec<Value> = document.objects.iter().map(|object| json!(object.attributes)).collect();
    assert_eq!(found, [json!({"d/x": "2"}), json!({"d/x": "1"})]);
}
