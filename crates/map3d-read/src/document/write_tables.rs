//! Writes a reader's tables and images into an asset.

use std::fs;

use map3d_base::asset::{AssetReport, AssetWriter, Materials};
use map3d_base::{Error, Result};

use super::DocumentReader;
use super::images::{DocumentImage, ImageSource};

/// Copies the images, writes the tables and closes the asset. Call it after the reader's last batch.
pub fn write_tables(reader: &dyn DocumentReader, mut writer: AssetWriter) -> Result<AssetReport> {
    for DocumentImage { source, extension, key, name, .. } in reader.textures() {
        if !name.is_empty() {
            writer.name_image(key, name);
        }
        match source {
            ImageSource::File(path) => {
                let bytes = fs::read(path).map_err(|e| Error::storage(path, e))?;
                if writer.add_texture(&bytes, extension)? != *key {
                    return Err(Error::format(path, "the image changed while the document was being read; import the document again"));
                }
            }
            ImageSource::Bytes(bytes) => _ = writer.add_texture(bytes, extension)?,
        }
    }
    let materials = Materials { materials: reader.materials().to_vec(), instances: reader.instances().to_vec() };
    writer.finish(&materials, reader.objects(), reader.report().clone())
}
