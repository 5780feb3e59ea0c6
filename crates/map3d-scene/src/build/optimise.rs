//! What the paper's optimisation drops within a cell.

use std::collections::HashSet;

use super::spill::Face;
use super::{BuildOptions, BuildReport};

/// Faces with the same three corners, of the same object and material, are drawn once: the first stays.
pub fn without_duplicates(mut faces: Vec<Face>, options: &BuildOptions, counts: &mut BuildReport) -> Vec<Face> {
    if !options.merge_faces {
        return faces;
    }
    let before = faces.len();
    let mut seen = HashSet::with_capacity(before);
    faces.retain(|face| {
        let mut corners = face.corners;
        corners.sort_unstable();
        seen.insert((corners, face.object, face.material))
    });
    counts.add("duplicate faces removed", (before - faces.len()) as u64);
    faces
}
