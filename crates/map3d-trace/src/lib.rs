//! Tracing: beams and rays through the chunks of a scene.
