//! References inside a document and into other documents of the given folder.
//!
//! Ids are hashes. Those of the document itself are plain; those of another document are mixed with a key of that document, so that equal ids of two
//! documents differ.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use map3d_base::{Reason, Result};

use crate::city_model::ids::{Id, IdMap, IdSet, hash_id, mix_id};
use crate::city_model::shared_geometry::MissingGeometry;
use crate::document::asset_folder::{AssetFolder, OTHER_FILE};

/// Index of a document in `References`.
pub type DocumentNumber = usize;

/// The document that is read.
pub const OWN_DOCUMENT: DocumentNumber = 0;

const MAX_DOCUMENTS: usize = 4096;
const MAX_NAMES: usize = 1 << 16;
const MAX_WANTED: usize = 1_000_000;
/// Longest reference that is kept for the report.
const MAX_REFERENCE_CHARS: usize = 200;
/// Longest file name that is kept.
const MAX_NAME_BYTES: usize = 1024;

/// A document, and its ids in those of `References`.
struct Document {
    path: PathBuf,
    /// Mixed with each id; 0 for the document that is read.
    key: Id,
    folder: AssetFolder,
}

/// An element that a reference leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Target {
    pub id: Id,
    pub document: DocumentNumber,
}

/// Elements that are not read yet: the id, and the first reference to it as written.
pub type WantedElements = IdMap<String>;

pub struct References {
    root: Option<PathBuf>,
    documents: Vec<Document>,
    /// Documents by the name that another one uses; `Err` for a name that leads to none.
    by_name: HashMap<(DocumentNumber, String), std::result::Result<DocumentNumber, Reason>>,
    /// Number of a second reading of the document itself, for other documents that refer back to it.
    own_copy: Option<DocumentNumber>,
    /// The document whose references are resolved.
    current: DocumentNumber,
    wanted: BTreeMap<DocumentNumber, WantedElements>,
    /// All geometry that was ever wanted.
    requested: IdSet,
    /// Elements of the document itself that appearances of other documents target.
    own_targets: WantedElements,
    missing: MissingGeometry,
}

impl References {
    /// `root`: the folder that references may lead into; by default, the document's own.
    pub fn new(document: &Path, root: Option<&Path>) -> Result<Self> {
        let own = Document { path: canonicalize(document), key: 0, folder: AssetFolder::for_document(document, root)? };
        Ok(Self {
            root: root.map(Path::to_path_buf),
            documents: vec![own],
            by_name: HashMap::new(),
            own_copy: None,
            current: OWN_DOCUMENT,
            wanted: BTreeMap::new(),
            requested: IdSet::default(),
            own_targets: WantedElements::default(),
            missing: MissingGeometry::default(),
        })
    }

    /// Returns the id of a reference to the document itself, as `#id`, `id` or `own.gml#id`; `None` for any other one.
    pub fn find_own_id(&self, href: &str) -> Option<Id> {
        let (file, id) = split_reference(href);
        let is_own = |file: &str| self.documents[OWN_DOCUMENT].path.file_name().is_some_and(|name| name == file.trim_start_matches("./"));
        (file.is_empty() || is_own(file)).then(|| hash_id(id))
    }

    /// Resolves a reference of the current document. The error is the reason why it leads nowhere.
    pub fn resolve(&mut self, href: &str) -> std::result::Result<Target, Reason> {
        self.resolve_within(href, self.current)
    }

    /// Resolves a reference of the current document; one without a file name is into `document`.
    pub fn resolve_within(&mut self, href: &str, document: DocumentNumber) -> std::result::Result<Target, Reason> {
        let (file, id) = split_reference(href);
        let document = if file.is_empty() { document } else { self.find_document(file)? };
        Ok(Target { id: mix_id(hash_id(id), self.documents[document].key), document })
    }

    /// Resolves a reference to geometry. That of another document is read later.
    pub fn resolve_geometry(&mut self, href: &str) -> std::result::Result<Id, Reason> {
        let target = self.resolve(href)?;
        if self.current == OWN_DOCUMENT && target.document == OWN_DOCUMENT {
            return Ok(target.id);
        }
        let Target { id, document } = if target.document == OWN_DOCUMENT { self.in_own_copy(target.id)? } else { target };
        if !self.requested.contains(&id) {
            if self.requested.len() >= MAX_WANTED {
                return Err(Reason::OtherFileReferencesTooMany);
            }
            self.requested.insert(id);
            let reference = self.describe(href);
            self.wanted.entry(document).or_default().insert(id, reference);
        }
        Ok(id)
    }

    /// Returns a reference as the report names it: a bare one of another document with the name of that document.
    fn describe(&self, href: &str) -> String {
        match split_reference(href) {
            ("", id) => format!("{}#{}", self.file_name(self.current), shorten(id)),
            _ => shorten(href),
        }
    }

    pub fn file_name(&self, document: DocumentNumber) -> String {
        self.documents[document].path.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }

    pub fn path(&self, document: DocumentNumber) -> &Path {
        &self.documents[document].path
    }

    pub fn key(&self, document: DocumentNumber) -> Id {
        self.documents[document].key
    }

    /// Adds another document by its path; returns `None` if it is the document itself or outside the folder.
    pub fn add_document(&mut self, path: &Path) -> Result<Option<DocumentNumber>> {
        let path = canonicalize(path);
        if path == self.documents[OWN_DOCUMENT].path || !self.documents[OWN_DOCUMENT].folder.contains(&path) {
            return Ok(None);
        }
        Ok(self.number_of(&path).ok())
    }

    /// Resolves references as those of this document from now on; returns the document before.
    pub fn enter(&mut self, document: DocumentNumber) -> DocumentNumber {
        std::mem::replace(&mut self.current, document)
    }

    pub fn is_in_other_document(&self) -> bool {
        self.current != OWN_DOCUMENT
    }

    /// Returns the name of a file that the current document names, relative to the document itself.
    pub fn relocate(&self, name: String) -> String {
        if self.current == OWN_DOCUMENT || name.starts_with(['/', '\\']) || name.contains(':') {
            return name;
        }
        let folder_of = |document: DocumentNumber| self.documents[document].path.parent().unwrap_or(Path::new("")).to_path_buf();
        let prefix = find_way(&folder_of(OWN_DOCUMENT), &folder_of(self.current));
        prefix.join(name).to_string_lossy().into_owned()
    }

    /// Takes the geometry to be read next, by document.
    pub fn take_wanted(&mut self) -> BTreeMap<DocumentNumber, WantedElements> {
        std::mem::take(&mut self.wanted)
    }

    /// Keeps the target of an appearance of another document, as written.
    pub fn add_own_target(&mut self, id: Id, href: &str) {
        if self.own_targets.len() < MAX_WANTED {
            self.own_targets.entry(id).or_insert_with(|| shorten(href));
        }
    }

    /// Takes the elements of the document itself that appearances of other documents target.
    pub fn take_own_targets(&mut self) -> WantedElements {
        std::mem::take(&mut self.own_targets)
    }

    /// Records why geometry is not there.
    pub fn fail(&mut self, wanted: WantedElements, reason: Reason) {
        self.missing.extend(wanted.into_iter().map(|(id, href)| (id, (reason, href))));
    }

    /// Geometry of other documents that is not there.
    pub fn missing(&self) -> &MissingGeometry {
        &self.missing
    }

    fn find_document(&mut self, name: &str) -> std::result::Result<DocumentNumber, Reason> {
        let key = (self.current, name.to_owned());
        if let Some(found) = self.by_name.get(&key) {
            return *found;
        }
        let file = self.documents[self.current].folder.find(name);
        let found = file.map_err(|error| error.reason(OTHER_FILE)).and_then(|file| self.number_of(&file.path));
        if self.by_name.len() < MAX_NAMES && name.len() <= MAX_NAME_BYTES {
            self.by_name.insert(key, found);
        }
        found
    }

    fn number_of(&mut self, path: &Path) -> std::result::Result<DocumentNumber, Reason> {
        match self.documents.iter().position(|document| document.path == path) {
            Some(number) => Ok(number),
            None => self.push_document(path),
        }
    }

    /// Returns the element with this id of the document itself in its second reading.
    fn in_own_copy(&mut self, id: Id) -> std::result::Result<Target, Reason> {
        let document = match self.own_copy {
            Some(number) => number,
            None => self.push_document(&self.documents[OWN_DOCUMENT].path.clone())?,
        };
        self.own_copy = Some(document);
        Ok(Target { id: mix_id(id, self.documents[document].key), document })
    }

    fn push_document(&mut self, path: &Path) -> std::result::Result<DocumentNumber, Reason> {
        if self.documents.len() >= MAX_DOCUMENTS {
            return Err(Reason::OtherFileReferencesTooMany);
        }
        // References of the document itself stay inside its own folder without a root; so do those of the documents that it refers to.
        let root = self.root.as_deref().or(self.documents[OWN_DOCUMENT].path.parent());
        let folder = AssetFolder::for_document(path, root).map_err(|_| Reason::OtherFileNotFound)?;
        let number = self.documents.len();
        self.documents.push(Document { path: path.to_path_buf(), key: hash_id(&format!("document {number}")), folder });
        Ok(number)
    }
}

fn canonicalize(path: &Path) -> PathBuf {
    std::fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf())
}

fn shorten(href: &str) -> String {
    href.trim().chars().take(MAX_REFERENCE_CHARS).collect()
}

/// Splits `file#id`. Some writers produce a bare `id`; a URL without a fragment is a file.
fn split_reference(href: &str) -> (&str, &str) {
    let href = href.trim();
    match href.split_once('#') {
        Some((file, id)) => (file.trim(), id),
        None if href.contains("://") => (href, ""),
        None => ("", href),
    }
}

/// Returns the relative path from one folder to another.
fn find_way(from: &Path, to: &Path) -> PathBuf {
    let shared = from.components().zip(to.components()).take_while(|(a, b)| a == b).count();
    let up = from.components().skip(shared).map(|_| "..");
    up.map(PathBuf::from).chain(to.components().skip(shared).map(|c| PathBuf::from(c.as_os_str()))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn references_may_omit_the_number_sign() {
        for (href, expected) in [
            ("#a", ("", "a")),
            (" a ", ("", "a")),
            ("b.gml#a", ("b.gml", "a")),
            ("http://x.y/z", ("http://x.y/z", "")),
            ("http://x.y/z#a", ("http://x.y/z", "a")),
        ] {
            assert_eq!(split_reference(href), expected, "{href}");
        }
    }

    #[test]
    fn ways_lead_up_and_down() {
        for (from, to, way) in [("/a/b", "/a/c/d", "../c/d"), ("/a", "/a", ""), ("/a", "/a/b", "b"), ("/a/b/c", "/", "../../..")] {
            assert_eq!(find_way(Path::new(from), Path::new(to)), Path::new(way), "{from} {to}");
        }
    }
}
