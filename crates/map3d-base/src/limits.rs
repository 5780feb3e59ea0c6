//! Limits that all languages share (spec/limits.json, spec/README.md). Python takes them from the compiled core; a test in each language compares them.

/// Allowed sides of a tile. Beams trace sub-tiles of 64 px, and every cost of a block grows with its tiles.
pub const TILE_PX: [u32; 2] = [256, 512];
/// The deepest level: the last one whose Morton numbers a JavaScript number holds exactly.
pub const DEEPEST_LEVEL: u8 = 26;
/// Minimum and maximum quality of a lossy colour format.
pub const QUALITY: [u8; 2] = [1, 100];
/// Maximum number of suns of a `sun16` layer: one bit each of its 16-bit pixels.
pub const MAX_SUNS: usize = 16;
/// Minimum and maximum radius of ambient occlusion. The cost of a block grows with everything within the radius.
pub const AO_RADIUS_M: [f64; 2] = [0.5, 200.0];
/// Pattern of a whole name of a scene, asset, rendering or layer.
pub const NAME_PATTERN: &str = "[a-z0-9][a-z0-9_-]{0,63}";
/// Maximum side of a source image, unless the reader's options set another limit.
pub const MAX_IMAGE_SIDE_PX: u64 = 16_384;
/// Maximum number of pixels of a source image, unless the reader's options set another limit.
pub const MAX_IMAGE_PX: u64 = 1 << 27;
/// Objects whose attributes share a file: ids with the same quotient.
pub const OBJECTS_PER_SHARD: u32 = 1024;
