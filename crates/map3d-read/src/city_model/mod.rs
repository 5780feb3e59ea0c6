//! City objects, their geometry and appearances, and their conversion to batches: what formats of city models share.

pub mod appearance;
pub mod attributes;
pub mod city_object;
pub mod code_lists;
pub mod converter;
pub mod crs_table;
pub mod feature_types;
pub mod geo_transform;
pub mod geometry_arena;
pub mod ids;
pub mod implicit_geometry;
pub mod lifespan;
pub mod lod_selection;
pub mod material_resolver;
pub mod own_appearance;
pub mod polygons;
pub mod prototype_table;
pub mod shared_geometry;
pub mod standard_codes;
pub mod tessellate;
pub mod theme_selection;
