//! Decodes codes: by the dictionary that `codeSpace` names if that is in the asset's folder, else by the lists of public standards
//! (`standard_codes`).

use std::collections::HashMap;
use std::path::Path;

use map3d_base::{Reason, Result};

use super::standard_codes::{Code, find_standard_label};
use crate::document::asset_folder::{AssetFolder, FileError};
use crate::document::report_builder::ReportBuilder;

const MAX_LISTS: usize = 4096;
/// Total for all lists.
const MAX_LIST_BYTES: u64 = 64 << 20;

/// Labels by code.
pub type CodeList = HashMap<String, String>;

/// Reads the dictionary in a file.
pub type ReadDictionary = fn(&Path) -> Result<CodeList>;

pub struct CodeLists {
    folder: AssetFolder,
    read_dictionary: ReadDictionary,
    /// Lists by `codeSpace`; `None` for one that is not a readable file.
    lists: HashMap<String, Option<CodeList>>,
    bytes: u64,
}

impl CodeLists {
    pub fn new(folder: AssetFolder, read_dictionary: ReadDictionary) -> Self {
        Self { folder, read_dictionary, lists: HashMap::new(), bytes: 0 }
    }

    /// Returns the label of a code; `None` if no list has it. Notes each list that is missing or unreadable.
    pub fn find_label(&mut self, code: Code, report: &mut ReportBuilder) -> Option<String> {
        let listed = code.space.and_then(|space| self.find_list(space, report)?.get(code.text).cloned());
        listed.or_else(|| find_standard_label(code).map(str::to_owned))
    }

    fn find_list(&mut self, space: &str, report: &mut ReportBuilder) -> Option<&CodeList> {
        if !self.lists.contains_key(space) {
            if self.lists.len() >= MAX_LISTS || !is_file_name(space) {
                return None;
            }
            let list = match self.read_list(space) {
                Ok(list) => Some(list),
                Err(reason) => {
                    report.note(Reason::CodeListNotRead, format!("{space}: {reason}"));
                    None
                }
            };
            self.lists.insert(space.to_owned(), list);
        }
        self.lists.get(space)?.as_ref()
    }

    fn read_list(&mut self, space: &str) -> std::result::Result<CodeList, String> {
        let file = self.folder.find(space).map_err(|error: FileError| error.describe().to_owned())?;
        self.bytes += file.path.metadata().map_err(|error| error.to_string())?.len();
        if self.bytes > MAX_LIST_BYTES {
            return Err(format!("code lists of more than {MAX_LIST_BYTES} bytes"));
        }
        (self.read_dictionary)(&file.path).map_err(|error| error.to_string())
    }
}

/// Returns true for the name of an XML file; code spaces are also URNs, URLs and plain words.
fn is_file_name(space: &str) -> bool {
    let suffix = space.trim().rsplit('.').next().unwrap_or_default();
    (suffix.eq_ignore_ascii_case("xml") || suffix.eq_ignore_ascii_case("gml")) && !space.contains("://")
}
