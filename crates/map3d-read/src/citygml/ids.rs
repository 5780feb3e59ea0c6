//! Identifiers and references as 64-bit hashes: a document may have tens of millions.

use std::collections::{HashMap, HashSet};
use std::hash::{BuildHasherDefault, Hasher};

use twox_hash::XxHash3_64;

/// Hash of a gml:id; `NONE` where there is no id.
pub type Id = u64;
pub const NONE: Id = 0;

pub type IdMap<V> = HashMap<Id, V, BuildHasherDefault<AsItIs>>;
pub type IdSet = HashSet<Id, BuildHasherDefault<AsItIs>>;

pub fn id_of(text: &str) -> Id {
    XxHash3_64::oneshot(text.trim().as_bytes()).max(1)
}

/// What a reference leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    Here(Id),
    OtherDocument,
}

/// `#id`, or the bare id that some writers put there. `other.gml#id` leads out of the document.
pub fn target_of(href: &str) -> Target {
    let href = href.trim();
    match href.split_once('#') {
        Some(("", id)) => Target::Here(id_of(id)),
        Some(_) => Target::OtherDocument,
        None if href.contains("://") => Target::OtherDocument,
        None => Target::Here(id_of(href)),
    }
}

/// Ids are hashes already.
#[derive(Default)]
pub struct AsItIs(u64);

impl Hasher for AsItIs {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|b| self.0 = self.0.rotate_left(8) ^ u64::from(*b));
    }

    fn write_u64(&mut self, value: u64) {
        self.0 = value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn references_are_read_with_and_without_hash() {
        assert_eq!(target_of("#a"), Target::Here(id_of("a")));
        assert_eq!(target_of(" a "), Target::Here(id_of("a")));
        assert_eq!(target_of("b.gml#a"), Target::OtherDocument);
        assert_eq!(target_of("http://x.y/z"), Target::OtherDocument);
    }
}
