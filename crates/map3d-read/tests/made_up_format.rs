//! A format that only this test has: what a reader delivers becomes an asset without a word about it anywhere else.

use std::fs;
use std::path::Path;

use crate::documents::{Folder, encode_png, is_error_of};
use map3d_base::asset::{AssetMesh, AssetReport, AssetWriter, Batch, Instance, Material, Materials, Object, Rank};
use map3d_base::{Error, Reason, Result};
use map3d_read::{DocumentImage, DocumentReader, FileHead, ImageSource, OpenDocument, ReadOptions, SourceFormat, open, write_tables};
use serde::Deserialize;

const SIGN: &SourceFormat = &SourceFormat {
    name: "sign",
    version: 1,
    is_library_object: false,
    detect: |head| head.bytes.starts_with(b"sign\n"),
    open: |path, options, _| -> Result<OpenDocument> { Ok(Box::new(SignReader::open(path, options)?)) },
};

#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct SignOptions {
    width: f64,
}

/// Reads a document whose image is in it: one triangle that shows the bytes after the first line.
struct SignReader {
    batch: Option<Batch>,
    images: Vec<DocumentImage>,
    materials: Vec<Material>,
    objects: Vec<Object>,
    instances: Vec<Instance>,
    report: AssetReport,
}

impl SignReader {
    fn open(path: &Path, options: &ReadOptions) -> Result<Self> {
        let SignOptions { width } = options.parse_of_format()?;
        let bytes = fs::read(path).map_err(|e| Error::storage(path, e))?;
        let image =
            DocumentImage::inspect(ImageSource::Bytes(bytes["sign\n".len()..].into()), options).map_err(|e| Error::format(path, e.to_string()))?;
        let batch = Batch {
            positions: vec![[0.0; 3], [width, 0.0, 0.0], [0.0, 0.0, 1.0]],
            triangles: vec![[0, 1, 2]],
            uvs: vec![[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]],
            materials: vec![0],
            objects: vec![0],
            ranks: vec![Rank::Other],
            ..Batch::default()
        };
        Ok(Self {
            batch: Some(batch),
            materials: vec![Material { texture: Some(image.key.clone()), cutout: image.transparent, ..Material::default() }],
            images: vec![image],
            objects: vec![Object { name: "sign".into(), class: "sign".into(), ..Object::default() }],
            instances: Vec::new(),
            report: AssetReport { format: SIGN.name.into(), ..AssetReport::default() },
        })
    }
}

impl DocumentReader for SignReader {
    fn next_batch(&mut self) -> Result<Option<Batch>> {
        Ok(self.batch.take())
    }

    fn srs_name(&self) -> Option<&str> {
        None
    }

    fn materials(&self) -> &[Material] {
        &self.materials
    }

    fn objects(&self) -> &[Object] {
        &self.objects
    }

    fn instances(&self) -> &[Instance] {
        &self.instances
    }

    fn instances_mut(&mut self) -> &mut Vec<Instance> {
        &mut self.instances
    }

    fn textures(&self) -> &[DocumentImage] {
        &self.images
    }

    fn report(&self) -> &AssetReport {
        &self.report
    }
}

fn put_sign(folder: &Folder, image: &[u8]) -> std::path::PathBuf {
    folder.put("a.sign", [b"sign\n", image].concat())
}

#[test]
fn an_image_inside_a_document_becomes_a_texture_of_the_asset() {
    let folder = Folder::new("sign");
    let image = encode_png(4, 2, [10, 20, 30, 40]);
    let path = put_sign(&folder, &image);
    assert!((SIGN.detect)(&FileHead::read(&path).expect("readable")));
    let options = ReadOptions::from_json("{\"width\": 2.0}").expect("valid");
    let mut reader = open(&path, SIGN, &options).expect("readable");
    let mut writer = AssetWriter::create(&folder.0.join("asset")).expect("a folder");
    while let Some(batch) = reader.next_batch().expect("a batch") {
        writer.append(&batch).expect("written");
    }
    let DocumentImage { key, extension, width_px, height_px, transparent, .. } = reader.textures()[0].clone();
    assert_eq!((extension, width_px, height_px, transparent), ("png", 4, 2, true));
    let report = write_tables(reader.as_ref(), writer).expect("an asset");
    assert_eq!((report.format.as_str(), report.triangles), ("sign", 1));
    let asset = folder.0.join("asset");
    assert_eq!(fs::read(asset.join(format!("textures/{key}.png"))).expect("a texture"), image);
    let materials: Materials = serde_json::from_slice(&fs::read(asset.join("materials.json")).expect("tables")).expect("valid");
    assert_eq!(materials.materials[0].texture.as_ref(), Some(&key));
    assert_eq!(AssetMesh::open(&asset.join("mesh.m3a")).expect("a mesh").positions()[1], [2.0, 0.0, 0.0]);
}

#[test]
fn images_inside_documents_have_the_limits_of_image_files() {
    let folder = Folder::new("sign");
    let path = put_sign(&folder, &encode_png(4, 2, [10, 20, 30, 40]));
    let limited = ReadOptions { max_image_px: 7, ..ReadOptions::default() };
    assert!(is_error_of(open(&path, SIGN, &limited), Reason::ImagePixelsOverLimit.with("limit", 7)));
    assert!(is_error_of(open(&put_sign(&folder, b"no image"), SIGN, &ReadOptions::default()), Reason::ImageFormatUnknown));
}

#[test]
fn options_of_other_formats_are_refused() {
    let folder = Folder::new("sign");
    let path = put_sign(&folder, &encode_png(1, 1, [0; 4]));
    let other = ReadOptions::from_json("{\"up\": \"y\"}").expect("valid");
    assert!(matches!(open(&path, SIGN, &other), Err(Error::Argument { .. })));
}
