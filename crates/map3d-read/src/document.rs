//! The contract of all readers.

use std::path::Path;

use map3d_base::asset::{AssetReport, Batch, Instance, Material, Object};
use map3d_base::{Error, Result};

use crate::citygml::CityGmlReader;
use crate::detect::Format;
use crate::image_file::Texture;
use crate::obj::ObjReader;
use crate::options::ReadOptions;

/// One source document, parsed as it is read. Tables are complete after the last batch; indices in batches never change.
pub trait DocumentReader {
    /// The next triangles in source order and source coordinates; `None` at the end of the document.
    fn next_batch(&mut self) -> Result<Option<Batch>>;
    /// As the source writes it; known before the first batch when the source states one.
    fn srs_name(&self) -> Option<&str>;
    fn materials(&self) -> &[Material];
    fn objects(&self) -> &[Object];
    fn instances(&self) -> &[Instance];
    fn instances_mut(&mut self) -> &mut [Instance];
    /// Images that the materials name, to be copied into the asset.
    fn textures(&self) -> &[Texture];
    fn report(&self) -> &AssetReport;

    /// Replaces the transforms of all instances, e.g. by reprojected ones; one for each, in order.
    fn set_instances(&mut self, transforms: &[[f64; 12]]) -> Result<()> {
        let instances = self.instances_mut();
        if instances.len() != transforms.len() {
            return Err(Error::argument(format!("{} transforms, expected {}: one for each instance", transforms.len(), instances.len())));
        }
        for (instance, transform) in instances.iter_mut().zip(transforms) {
            instance.transform = *transform;
        }
        Ok(())
    }
}

/// Opens a document for reading.
pub fn open(path: &Path, format: Format, options: &ReadOptions) -> Result<Box<dyn DocumentReader + Send>> {
    Ok(match format {
        Format::Obj => Box::new(ObjReader::open(path, options)?),
        Format::CityGml => Box::new(CityGmlReader::open(path, options)?),
    })
}
