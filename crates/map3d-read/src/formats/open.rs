//! Opens a document by its format, and writes a reader's tables into an asset.

use std::fs;
use std::path::Path;

use map3d_base::asset::{AssetReport, AssetWriter, Materials};
use map3d_base::{Error, Result};

use super::citygml::CityGmlReader;
use super::detect::Format;
use super::obj::ObjReader;
use crate::document::DocumentReader;
use crate::document::options::ReadOptions;

/// Opens a document for reading.
pub fn open(path: &Path, format: Format, options: &ReadOptions) -> Result<Box<dyn DocumentReader + Send>> {
    Ok(match format {
        Format::Obj => Box::new(ObjReader::open(path, options)?),
        Format::CityGml => Box::new(CityGmlReader::open(path, options)?),
    })
}

/// Copies the images, writes the tables and closes the asset. Call it after the reader's last batch.
pub fn write_tables(reader: &dyn DocumentReader, mut writer: AssetWriter) -> Result<AssetReport> {
    for image in reader.textures() {
        let bytes = fs::read(&image.path).map_err(|e| Error::storage(&image.path, e))?;
        if writer.add_texture(&bytes, image.extension)? != image.key {
            return Err(Error::format(&image.path, "the image changed while the document was being read; import the document again"));
        }
    }
    let materials = Materials { materials: reader.materials().to_vec(), instances: reader.instances().to_vec() };
    writer.finish(&materials, reader.objects(), reader.report().clone())
}
