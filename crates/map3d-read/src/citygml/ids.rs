//! Identifiers and references, stored as 64-bit hashes because a document may have tens of millions.

use std::collections::{HashMap, HashSet};
use std::hash::{BuildHasherDefault, Hasher};

use twox_hash::XxHash3_64;

/// Hash of a gml:id; `NONE` for an element without one.
pub type Id = u64;
pub const NONE: Id = 0;

pub type IdMap<V> = HashMap<Id, V, BuildHasherDefault<IdentityHasher>>;
pub type IdSet = HashSet<Id, BuildHasherDefault<IdentityHasher>>;

pub fn hash_id(text: &str) -> Id {
    XxHash3_64::oneshot(text.trim().as_bytes()).max(1)
}

/// A reference to an element by its id.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reference {
    /// To an element of the same document.
    Internal(Id),
    /// To another document.
    External,
}

/// Parses `#id` or, as some writers produce, a bare `id`. `other.gml#id` and URLs are external.
pub fn parse_reference(href: &str) -> Reference {
    let href = href.trim();
    match href.split_once('#') {
        Some(("", id)) => Reference::Internal(hash_id(id)),
        Some(_) => Reference::External,
        None if href.contains("://") => Reference::External,
        None => Reference::Internal(hash_id(href)),
    }
}

/// Returns ids unchanged: they are hashes already.
#[derive(Default)]
pub struct IdentityHasher(u64);

impl Hasher for IdentityHasher {
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
    fn references_may_omit_the_number_sign() {
        assert_eq!(parse_reference("#a"), Reference::Internal(hash_id("a")));
        assert_eq!(parse_reference(" a "), Reference::Internal(hash_id("a")));
        assert_eq!(parse_reference("b.gml#a"), Reference::External);
        assert_eq!(parse_reference("http://x.y/z"), Reference::External);
    }
}
