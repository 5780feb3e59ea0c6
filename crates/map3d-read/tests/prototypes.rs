//! Implicit geometry: prototypes and placements.

use crate::documents::{Folder, ParsedDocument, is_limit_error, read_with};
use map3d_read::{CITYGML, ReadOptions, open};

fn tree(id: &str, matrix: &str, geometry: &str, reference: &str) -> String {
    format!(
        "<cityObjectMember><SolitaryVegetationObject gml:id='{id}'><lod2ImplicitRepresentation><ImplicitGeometry>{matrix}{geometry}\
         <referencePoint><gml:Point><gml:pos>{reference}</gml:pos></gml:Point></referencePoint></ImplicitGeometry></lod2ImplicitRepresentation></SolitaryVegetationObject></cityObjectMember>"
    )
}

const MATRIX: &str = "<transformationMatrix>2 0 0 1 0 2 0 0 0 0 2 0 0 0 0 1</transformationMatrix>";
const SHAPE: &str = "<relativeGMLGeometry><gml:MultiSurface gml:id='oak'><gml:surfaceMember><gml:Polygon><gml:exterior><gml:LinearRing><gml:posList>0 0 0 1 0 0 0 1 0 0 0 0</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember></gml:MultiSurface></relativeGMLGeometry>";
const SAME: &str = "<relativeGMLGeometry xlink:href='#oak'/>";

fn read(members: &str, options: &ReadOptions) -> map3d_base::Result<ParsedDocument> {
    let folder = Folder::new("prototypes");
    folder.put("lamp.obj", "mtllib lamp.mtl\nv 0 0 0\nv 1 0 0\nv 0 0 1\nusemtl m\nf 1 2 3\n");
    folder.put("lamp.mtl", "newmtl m\nKd 1 1 0\n");
    folder.put("lamp.wrl", "#VRML V2.0 utf8\n");
    let path = folder.put("a.gml", format!("<CityModel xmlns:gml='g' xmlns:xlink='x'>{members}</CityModel>"));
    read_with(&path, &CITYGML, options)
}

fn read_with_defaults(members: &str) -> ParsedDocument {
    read(members, &ReadOptions::default()).expect("readable")
}

#[test]
fn prototypes_are_converted_once_and_placed_many_times() {
    let (a, b) = (tree("a", MATRIX, SHAPE, "100 200 5"), tree("b", "", SAME, "300 400 6"));
    for (members, order) in [(a.clone() + &b, [0, 1]), (b + &a, [1, 0])] {
        let document = read_with_defaults(&members);
        assert_eq!((document.count(), document.batches.len(), document.batches[0].prototype), (1, 1, 1));
        assert_eq!(document.triangles()[0].corners[1], [1.0, 0.0, 0.0], "in the prototype's frame");
        assert_eq!(document.objects.len(), 2);
        let [first, second] = order.map(|k| document.instances[k].transform);
        assert_eq!(first, [2.0, 0.0, 0.0, 101.0, 0.0, 2.0, 0.0, 200.0, 0.0, 0.0, 2.0, 5.0]);
        assert_eq!(second, [1.0, 0.0, 0.0, 300.0, 0.0, 1.0, 0.0, 400.0, 0.0, 0.0, 1.0, 6.0]);
    }
}

#[test]
fn prototypes_without_id_are_not_shared() {
    let shape = SHAPE.replace(" gml:id='oak'", "");
    let document = read_with_defaults(&(tree("a", "", &shape, "0 0 0") + &tree("b", "", &shape, "1 1 1")));
    assert_eq!(document.instances.iter().map(|i| i.prototype).collect::<Vec<_>>(), [1, 2]);
}

#[test]
fn invalid_implicit_geometry_is_skipped_and_counted() {
    for (case, member, reason) in [
        ("no prototype", tree("a", MATRIX, "", "0 0 0"), "implicit-geometry-without-prototype"),
        ("unresolved prototype", tree("a", MATRIX, SAME, "0 0 0"), "implicit-geometry-without-prototype"),
        ("broken matrix", tree("a", "<transformationMatrix>1 2 3</transformationMatrix>", SHAPE, "0 0 0"), "implicit-geometry-matrix-invalid"),
        ("no reference point", tree("a", MATRIX, SHAPE, ""), "implicit-geometry-without-reference-point"),
        ("not finite", tree("a", MATRIX, SHAPE, "nan 0 0"), "implicit-geometry-matrix-invalid"),
    ] {
        let document = read_with_defaults(&member);
        assert_eq!((document.instances.len(), document.objects.len()), (0, 1), "{case}");
        assert_eq!(document.reported(reason), 1, "{case}: {:?}", document.report);
    }
}

#[test]
fn library_objects_are_read_from_obj_files_in_the_folder() {
    let library = |name: &str| format!("<libraryObject>{name}</libraryObject>");
    let document = read_with_defaults(&(tree("a", "", &library("lamp.obj"), "1 2 3") + &tree("b", "", &library("lamp.obj"), "4 5 6")));
    assert_eq!((document.count(), document.instances.len()), (1, 2));
    assert_eq!(document.material_of(0).diffuse, [1.0, 1.0, 0.0, 1.0]);
    for (name, reason) in [
        ("../lamp.obj", "library-object-outside-folder"),
        ("http://host.example/lamp.obj", "library-object-url-not-fetched"),
        ("none.obj", "library-object-not-found"),
        ("lamp.wrl", "library-object-format-not-read"),
    ] {
        let document = read_with_defaults(&tree("a", "", &library(name), "1 2 3"));
        assert_eq!(document.instances.len(), 0, "{name}");
        assert_eq!(document.reported(reason), 1, "{name}: {:?}", document.report);
    }
}

#[test]
fn instances_over_the_limit_are_an_error() {
    let members = tree("a", "", SHAPE, "0 0 0") + &tree("b", "", SAME, "1 1 1");
    for (limit, is_ok) in [(2, true), (1, false)] {
        let result = read(&members, &ReadOptions { max_instances: limit, ..ReadOptions::default() });
        assert!(if is_ok { result.is_ok() } else { is_limit_error(result, "max_instances") });
    }
}

#[test]
fn set_instances_needs_one_transform_per_instance() {
    let folder = Folder::new("replace");
    let path = folder.put("a.gml", format!("<CityModel xmlns:gml='g'>{}</CityModel>", tree("a", "", SHAPE, "7 8 9")));
    let mut reader = open(&path, &CITYGML, &ReadOptions::default()).expect("readable");
    while reader.next_batch().expect("readable").is_some() {}
    assert!(reader.set_instances(&[]).is_err());
    assert_eq!(reader.set_instances(&[[3.0; 12]]).expect("one transform"), 0);
    assert_eq!(reader.instances()[0].transform, [3.0; 12]);
    assert_eq!(reader.set_instances(&[[f64::NAN; 12]]).expect("one transform"), 1);
    assert!(reader.instances().is_empty(), "what has no place is removed");
}
