//! The interface of all readers, and what they share: options, files, text, images, materials, the report.

pub mod asset_folder;
mod byte_source;
pub mod file_head;
pub mod images;
mod lossy_utf8;
pub mod material_table;
pub mod options;
pub mod report_builder;
pub mod source_format;
pub mod text_input;
pub mod transparency;
pub mod write_tables;

use std::path::PathBuf;

use map3d_base::asset::{AssetReport, Batch, Instance, Material, Object};
use map3d_base::{Error, Result};
use serde::Serialize;

use self::images::DocumentImage;

/// A raster file with the heights of a relief. The value at (column, row) is at first + column · column_step + row · row_step, in the order of axes
/// of the document.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReliefGrid {
    /// Name of the city object, empty without one.
    pub object: String,
    /// Inside the folder of the document.
    pub file: PathBuf,
    pub columns: u64,
    pub rows: u64,
    pub first: [f64; 2],
    pub column_step: [f64; 2],
    pub row_step: [f64; 2],
    /// As the document writes it.
    pub crs: Option<String>,
}

/// One source document, parsed as it is read. The tables are complete after the last batch; indices in earlier batches stay valid.
pub trait DocumentReader {
    /// Returns the next triangles in source order and source coordinates; `None` at the end of the document.
    fn next_batch(&mut self) -> Result<Option<Batch>>;
    /// The CRS as the source writes it; `None` if the source states no CRS. Known before the first batch.
    fn srs_name(&self) -> Option<&str>;
    /// Coordinate systems that parts of the document are in, as it writes them; batches and instances have indices into them. The first is the
    /// document's. Complete after the last batch, and known for each batch when it is returned.
    fn crs_names(&self) -> Vec<Option<&str>> {
        vec![self.srs_name()]
    }
    /// Coordinate systems of the instances before `set_instances`, as indices into `crs_names`; empty if all are in the document's.
    fn instance_crs(&self) -> &[u16] {
        &[]
    }
    /// Rasters with the heights of reliefs; complete after the last batch.
    fn grids(&self) -> &[ReliefGrid] {
        &[]
    }
    fn materials(&self) -> &[Material];
    fn objects(&self) -> &[Object];
    fn instances(&self) -> &[Instance];
    fn instances_mut(&mut self) -> &mut Vec<Instance>;
    /// Images that the materials refer to, to be copied into the asset; complete after the last batch.
    fn textures(&self) -> &[DocumentImage];
    fn report(&self) -> &AssetReport;

    /// Replaces the transforms of all instances, for example by reprojected ones. Takes one transform per instance, in order. Removes the instances
    /// whose transforms are not finite; returns their number.
    fn set_instances(&mut self, transforms: &[[f64; 12]]) -> Result<usize> {
        let instances = self.instances_mut();
        if instances.len() != transforms.len() {
            return Err(Error::argument(format!(
                "got {} transforms for {} instances; pass one transform per instance",
                transforms.len(),
                instances.len()
            )));
        }
        for (instance, transform) in instances.iter_mut().zip(transforms) {
            instance.transform = *transform;
        }
        instances.retain(|instance| instance.transform.iter().all(|v| v.is_finite()));
        Ok(transforms.len() - instances.len())
    }
}
