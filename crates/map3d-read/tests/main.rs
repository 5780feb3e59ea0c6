//! All tests of the readers in one program, which is linked once.

mod appearance;
mod citygml;
mod citygml3;
mod citygml_attributes;
mod citygml_faults;
mod citygml_lods;
mod coordinate_systems;
mod documents;
mod files;
mod gzip;
mod large_polygons;
mod made_up_format;
mod mutation;
mod obj;
mod odd_documents;
mod prototypes;
mod real_data;
mod references;
mod relief_grids;
mod tin;
mod transparency;
mod triangulation;
