//! Beams: all samples of a sub-tile at once, through the trees of all parts that it meets, front to back.

pub(crate) mod buffer;
pub(crate) mod project;

use map3d_base::{Frame, Result};
use map3d_scene::SceneStore;

use crate::cutout::Cutout;
use crate::visbuf::VisBuf;

/// Traces sub-tiles of one view; keep one per thread, its buffers are reused.
pub struct BeamTracer<'s> {
    scene: &'s SceneStore,
    result: VisBuf,
}

impl<'s> BeamTracer<'s> {
    /// Fails for a frame that is not sound.
    pub fn new(scene: &'s SceneStore, frame: &Frame) -> Result<Self> {
        frame.validate()?;
        Ok(Self { scene, result: VisBuf::new(frame) })
    }

    /// Traces the `SUBTILE_PX`² pixels whose top left one is (x_px, y_px), counted at level zmax from the square's top left corner.
    pub fn trace(&mut self, x_px: u64, y_px: u64, cutout: &dyn Cutout) -> Result<&VisBuf> {
        self.result.restart([x_px, y_px]);
        let _ = (self.scene, cutout);
        todo!()
    }
}
