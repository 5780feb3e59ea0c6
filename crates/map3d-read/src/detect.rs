//! Which format a file has, by its content.

use std::path::Path;

use map3d_base::{Error, Result};
use serde::{Deserialize, Serialize};

use crate::text::{open_lines, open_xml};
use std::io::Read;

/// Formats that can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    Obj,
    CityGml,
}

impl Format {
    pub fn name(self) -> &'static str {
        match self {
            Self::Obj => "obj",
            Self::CityGml => "citygml",
        }
    }
}

impl std::str::FromStr for Format {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        match name {
            "obj" => Ok(Self::Obj),
            "citygml" => Ok(Self::CityGml),
            _ => Err(Error::argument(format!("format {name:?}: expected \"obj\" or \"citygml\""))),
        }
    }
}

const LOOK_BYTES: u64 = 1 << 16;
/// First words of OBJ lines that no other text begins with so readily.
const OBJ_WORDS: [&str; 14] = ["v", "vt", "vn", "vp", "f", "l", "p", "o", "g", "s", "mtllib", "usemtl", "usemap", "call"];

/// Looks at the beginning of a file. An error says that it is nothing that can be read.
pub fn detect_format(path: &Path) -> Result<Format> {
    let mut head = Vec::new();
    open_xml(path)?.take(LOOK_BYTES).read_to_end(&mut head).map_err(|e| Error::storage(path, e))?;
    let text = String::from_utf8_lossy(&head);
    if text.trim_start_matches('\u{feff}').trim_start().starts_with('<') {
        return match root_of(&text) {
            Some("CityModel") => Ok(Format::CityGml),
            Some(root) => Err(Error::format(path, format!("an XML document with the root {root:?}; expected CityModel (CityGML)"))),
            None => Err(Error::format(path, "an XML document without a root element")),
        };
    }
    head.clear();
    open_lines(path)?.take(LOOK_BYTES).read_to_end(&mut head).map_err(|e| Error::storage(path, e))?;
    if looks_like_obj(&head) { Ok(Format::Obj) } else { Err(Error::format(path, "neither OBJ nor CityGML")) }
}

/// Local name of the first element.
fn root_of(text: &str) -> Option<&str> {
    let mut rest = text;
    loop {
        rest = &rest[rest.find('<')? + 1..];
        if let Some(comment) = rest.strip_prefix("!--") {
            rest = &comment[comment.find("-->")?..];
        } else if !rest.starts_with(['!', '?']) {
            let name = rest.split(|c: char| c.is_whitespace() || c == '>' || c == '/').next()?;
            return Some(name.rsplit(':').next().unwrap_or(name));
        }
    }
}

/// Every line that says something begins with a word of the format; one unknown word in ten is borne.
fn looks_like_obj(head: &[u8]) -> bool {
    if head.contains(&0) {
        return false;
    }
    let text = String::from_utf8_lossy(head);
    let lines: Vec<&str> = text.split(['\n', '\r']).map(str::trim).filter(|l| !l.is_empty() && !l.starts_with('#')).collect();
    let known = lines.iter().filter(|l| l.split_whitespace().next().is_some_and(|w| OBJ_WORDS.contains(&w))).count();
    known > 0 && known * 10 >= lines.len() * 9
}
