//! Decodes codes: by the dictionary that `codeSpace` names if that is in the asset's folder, else by the lists of public standards
//! (`standard_codes`).

use std::collections::HashMap;
use std::path::Path;

use map3d_base::{Error, Result};

use super::standard_codes::find_standard_label;
use crate::document::asset_folder::{AssetFolder, FileError};
use crate::document::report_builder::ReportBuilder;
use crate::formats::citygml::xml_reader::{XmlEvent, XmlReader};

const MAX_LISTS: usize = 4096;
/// Of all lists together.
const MAX_LIST_BYTES: u64 = 64 << 20;

/// Labels by code.
type CodeList = HashMap<String, String>;

/// A code as the document writes it.
#[derive(Clone, Copy, Debug)]
pub struct Code<'a> {
    /// Local name of the property that has it.
    pub property: &'a str,
    pub space: Option<&'a str>,
    pub text: &'a str,
    /// The object has codes of the German cadastre.
    pub is_adv: bool,
}

pub struct CodeLists {
    folder: AssetFolder,
    /// Lists by `codeSpace`; `None` for one that is not a readable file.
    lists: HashMap<String, Option<CodeList>>,
    bytes: u64,
}

impl CodeLists {
    pub fn new(folder: AssetFolder) -> Self {
        Self { folder, lists: HashMap::new(), bytes: 0 }
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
                    report.note("code list not read; its codes are kept as they are", format!("{space}: {reason}"));
                    None
                }
            };
            self.lists.insert(space.to_owned(), list);
        }
        self.lists.get(space)?.as_ref()
    }

    fn read_list(&mut self, space: &str) -> std::result::Result<CodeList, String> {
        let file = self.folder.find(space).map_err(|error: FileError| error.reason().to_owned())?;
        self.bytes += file.path.metadata().map_err(|error| error.to_string())?.len();
        if self.bytes > MAX_LIST_BYTES {
            return Err(format!("code lists of more than {MAX_LIST_BYTES} bytes"));
        }
        read_dictionary(&file.path).map_err(|error| error.to_string())
    }
}

/// Returns true for the name of an XML file; code spaces are also URNs, URLs and plain words.
fn is_file_name(space: &str) -> bool {
    let suffix = space.trim().rsplit('.').next().unwrap_or_default();
    (suffix.eq_ignore_ascii_case("xml") || suffix.eq_ignore_ascii_case("gml")) && !space.contains("://")
}

fn read_dictionary(path: &Path) -> Result<CodeList> {
    let mut xml = XmlReader::open(path)?;
    loop {
        match xml.next_event()? {
            XmlEvent::Start => break,
            XmlEvent::Eof => return Err(Error::format(path, "no XML element; expected a dictionary")),
            XmlEvent::End | XmlEvent::Text => {}
        }
    }
    if !is_dictionary(xml.local_name()) {
        return Err(Error::format(path, format!("the root element is {:?}; expected Dictionary", xml.local_name())));
    }
    let mut list = CodeList::new();
    read_entries(&mut xml, &mut list)?;
    Ok(list)
}

fn is_dictionary(local_name: &str) -> bool {
    matches!(local_name, "Dictionary" | "DefinitionCollection")
}

/// Reads the current dictionary and those in it.
fn read_entries(xml: &mut XmlReader, list: &mut CodeList) -> Result<()> {
    while xml.next_child()? {
        if !matches!(xml.local_name(), "dictionaryEntry" | "definitionMember" | "indirectEntry") {
            xml.skip()?;
            continue;
        }
        while xml.next_child()? {
            match xml.local_name() {
                "Definition" | "DefinitionProxy" => read_definition(xml)?.add_to(list),
                name if is_dictionary(name) => read_entries(xml, list)?,
                _ => xml.skip()?,
            }
        }
    }
    Ok(())
}

/// The names of one definition. Producers disagree on which of them is the code.
#[derive(Default)]
struct Definition {
    identifier: String,
    /// A name with a `codeSpace` comes first.
    names: Vec<String>,
    description: String,
}

fn read_definition(xml: &mut XmlReader) -> Result<Definition> {
    let mut definition = Definition::default();
    while xml.next_child()? {
        match xml.local_name() {
            "identifier" => definition.identifier = xml.read_text()?,
            "description" => definition.description = xml.read_text()?,
            "name" => {
                let at = if xml.attribute("codeSpace").is_some() { 0 } else { definition.names.len() };
                let name = xml.read_text()?;
                definition.names.insert(at, name);
            }
            _ => xml.skip()?,
        }
    }
    Ok(definition)
}

impl Definition {
    /// The code is the first of two names, or the only one beside a description (PLATEAU, SIG3D), or the identifier (GML 3.2, INSPIRE).
    fn add_to(self, list: &mut CodeList) {
        let Self { identifier, mut names, description } = self;
        names.retain(|name| !name.is_empty());
        let mut add = |code: &str, label: &str| {
            if !code.is_empty() && !label.is_empty() && code != label {
                list.entry(code.to_owned()).or_insert_with(|| label.to_owned());
            }
        };
        match &names[..] {
            [code, label, ..] => add(code, label),
            [code] => add(code, &description),
            [] => {}
        }
        let label = names.last().unwrap_or(&description);
        add(&identifier, label);
        add(identifier.rsplit('/').next().unwrap_or_default(), label);
    }
}
