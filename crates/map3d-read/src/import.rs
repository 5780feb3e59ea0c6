//! A document into an asset folder, in source coordinates.

use std::fs;
use std::path::Path;

use map3d_base::asset::{AssetReport, AssetWriter, Materials};
use map3d_base::{Error, Result};

use crate::detect::Format;
use crate::document::{DocumentReader, open};
use crate::options::ReadOptions;

/// Reads a whole document into an asset folder; coordinates stay those of the source.
pub fn import(path: &Path, format: Format, options: &ReadOptions, folder: &Path) -> Result<AssetReport> {
    let mut reader = open(path, format, options)?;
    let mut writer = AssetWriter::create(folder)?;
    while let Some(batch) = reader.next_batch()? {
        writer.append(&batch)?;
    }
    write_tables(reader.as_ref(), writer)
}

/// Copies the images, writes the tables and closes the asset. The reader must have been read to its end.
pub fn write_tables(reader: &dyn DocumentReader, mut writer: AssetWriter) -> Result<AssetReport> {
    for texture in reader.textures() {
        let bytes = fs::read(&texture.path).map_err(|e| Error::storage(&texture.path, e))?;
        if writer.add_texture(&bytes, texture.extension)? != texture.key {
            return Err(Error::format(&texture.path, "the image changed while the document was read"));
        }
    }
    let materials = Materials { materials: reader.materials().to_vec(), instances: reader.instances().to_vec() };
    writer.finish(&materials, reader.objects(), reader.report().clone())
}
