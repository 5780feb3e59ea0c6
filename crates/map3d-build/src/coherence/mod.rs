//! What the check of coherence needs of assets (python/map3d/coherence): where their objects are, which of them are equal, how high the ground
//! below points is; and the geometry of objects that are draped over the ground.

mod drape;
mod plan_index;
mod surfaces;
mod survey;

pub use drape::{DRAPED_FOLDER, Draping, drape};
pub use surfaces::{Surface, surface_heights};
pub use survey::{SURVEY_FILE, Survey, SurveyedObject, read_or_survey};
