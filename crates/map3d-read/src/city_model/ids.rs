//! Identifiers, stored as 64-bit hashes because a document may have tens of millions.

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

/// Mixes the id of an element with the key of its document, 0 for the document that is read.
pub fn mix_id(id: Id, document_key: Id) -> Id {
    if id == NONE { id } else { (id ^ document_key).max(1) }
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
    fn ids_of_two_documents_differ() {
        let id = hash_id("a");
        assert_eq!(mix_id(id, 0), id);
        assert_eq!(mix_id(NONE, 7), NONE);
        assert_ne!(mix_id(id, 7), id);
        assert_ne!(mix_id(id, id), NONE);
    }
}
