//! Parses dictionaries of codes.

use std::path::Path;

use map3d_base::{Error, Result};

use super::xml_reader::{XmlEvent, XmlReader};
use crate::city_model::code_lists::CodeList;

/// Reads the codes and labels of a dictionary.
pub fn read_dictionary(path: &Path) -> Result<CodeList> {
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
