//! Options that only OBJ has.

use serde::Deserialize;

/// The axis of an OBJ that points up. `Y` turns (x, y, z) into (x, −z, y).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Up {
    Y,
    #[default]
    Z,
}

/// The part of an OBJ that becomes one object.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Split {
    #[default]
    File,
    Group,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ObjOptions {
    pub up: Up,
    pub split: Split,
}
