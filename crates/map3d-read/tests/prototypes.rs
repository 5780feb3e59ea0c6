//! Implicit geometry: prototypes and their placements.

mod reading;

use map3d_read::{Format, ReadOptions, open};
use reading::{Folder, Reading, is_limit_error, read_with};

fn tree(id: &str, matrix: &str, geometry: &str, reference: &str) -> String {
    format!(
        "<cityObjectMember><SolitaryVegetationObject gml:id='{id}'><lod2ImplicitRepresentation><ImplicitGeometry>{matrix}{geometry}\
         <referencePoint><gml:Point><gml:pos>{reference}</gml:pos></gml:Point></referencePoint></ImplicitGeometry></lod2ImplicitRepresentation></SolitaryVegetationObject></cityObjectMember>"
    )
}

const MATRIX: &str = "<transformationMatrix>2 0 0 1 0 2 0 0 0 0 2 0 0 0 0 1</transformationMatrix>";
const SHAPE: &str = "<relativeGMLGeometry><gml:MultiSurface gml:id='oak'><gml:surfaceMember><gml:Polygon><gml:exterior><gml:LinearRing><gml:posList>0 0 0 1 0 0 0 1 0 0 0 0</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember></gml:MultiSurface></relativeGMLGeometry>";
const SAME: &str = "<relativeGMLGeometry xlink:href='#oak'/>";

fn read(members: &str, options: &ReadOptions) -> map3d_base::Result<Reading> {
    let folder = Folder::new("prototypes");
    folder.put("lamp.obj", "mtllib lamp.mtl\nv 0 0 0\nv 1 0 0\nv 0 0 1\nusemtl m\nf 1 2 3\n");
    folder.put("lamp.mtl", "newmtl m\nKd 1 1 0\n");
    folder.put("lamp.wrl", "#VRML V2.0 utf8\n");
    let path = folder.put("a.gml", format!("<CityModel xmlns:gml='g' xmlns:xlink='x'>{members}</CityModel>"));
    read_with(&path, Format::CityGml, options)
}

fn defaults(members: &str) -> Reading {
    read(members, &ReadOptions::default()).expect("readable")
}

#[test]
fn a_prototype_is_drawn_once_and_placed_often() {
    let (a, b) = (tree("a", MATRIX, SHAPE, "100 200 5"), tree("b", "", SAME, "300 400 6"));
    for (members, order) in [(a.clone() + &b, [0, 1]), (b + &a, [1, 0])] {
        let reading = defaults(&members);
        assert_eq!((reading.count(), reading.batches.len(), reading.batches[0].prototype), (1, 1, 1));
        assert_eq!(reading.triangles()[0].corners[1], [1.0, 0.0, 0.0], "in its own frame");
        assert_eq!(reading.objects.len(), 2);
        let [first, second] = order.map(|k| reading.instances[k].transform);
        assert_eq!(first, [2.0, 0.0, 0.0, 101.0, 0.0, 2.0, 0.0, 200.0, 0.0, 0.0, 2.0, 5.0]);
        assert_eq!(second, [1.0, 0.0, 0.0, 300.0, 0.0, 1.0, 0.0, 400.0, 0.0, 0.0, 1.0, 6.0]);
    }
}

#[test]
fn prototypes_without_id_are_their_own() {
    let shape = SHAPE.replace(" gml:id='oak'", "");
    let reading = defaults(&(tree("a", "", &shape, "0 0 0") + &tree("b", "", &shape, "1 1 1")));
    assert_eq!(reading.instances.iter().map(|i| i.prototype).collect::<Vec<_>>(), [1, 2]);
}

#[test]
fn what_cannot_be_placed_is_counted() {
    for (case, member, reason) in [
        ("no prototype", tree("a", MATRIX, "", "0 0 0"), "without a prototype"),
        ("lost prototype", tree("a", MATRIX, SAME, "0 0 0"), "without a prototype"),
        ("broken matrix", tree("a", "<transformationMatrix>1 2 3</transformationMatrix>", SHAPE, "0 0 0"), "unusable transformation matrix"),
        ("no reference point", tree("a", MATRIX, SHAPE, ""), "without a reference point"),
        ("not finite", tree("a", MATRIX, SHAPE, "nan 0 0"), "unusable transformation matrix"),
    ] {
        let reading = defaults(&member);
        assert_eq!((reading.instances.len(), reading.objects.len()), (0, 1), "{case}");
        assert_eq!(reading.skipped(reason), 1, "{case}: {:?}", reading.report);
    }
}

#[test]
fn library_objects_are_read_when_they_are_obj_in_the_folder() {
    let library = |name: &str| format!("<libraryObject>{name}</libraryObject>");
    let reading = defaults(&(tree("a", "", &library("lamp.obj"), "1 2 3") + &tree("b", "", &library("lamp.obj"), "4 5 6")));
    assert_eq!((reading.count(), reading.instances.len()), (1, 2));
    assert_eq!(reading.material_of(0).diffuse, [1.0, 1.0, 0.0, 1.0]);
    for (name, reason) in [("../lamp.obj", "outside"), ("http://host.example/lamp.obj", "URL"), ("none.obj", "not found"), ("lamp.wrl", "not read")] {
        let reading = defaults(&tree("a", "", &library(name), "1 2 3"));
        assert_eq!(reading.instances.len(), 0, "{name}");
        assert_eq!(reading.warned(reason), 1, "{name}: {:?}", reading.report);
    }
}

#[test]
fn instances_over_their_limit_are_refused() {
    let members = tree("a", "", SHAPE, "0 0 0") + &tree("b", "", SAME, "1 1 1");
    for (limit, sound) in [(2, true), (1, false)] {
        let result = read(&members, &ReadOptions { max_instances: limit, ..ReadOptions::default() });
        assert!(if sound { result.is_ok() } else { is_limit_error(result, "max_instances") });
    }
}

#[test]
fn transforms_are_replaced_all_or_none() {
    let folder = Folder::new("replace");
    let path = folder.put("a.gml", format!("<CityModel xmlns:gml='g'>{}</CityModel>", tree("a", "", SHAPE, "7 8 9")));
    let mut reader = open(&path, Format::CityGml, &ReadOptions::default()).expect("readable");
    while reader.next_batch().expect("readable").is_some() {}
    assert!(reader.set_instances(&[]).is_err());
    reader.set_instances(&[[3.0; 12]]).expect("one for one");
    assert_eq!(reader.instances()[0].transform, [3.0; 12]);
}
