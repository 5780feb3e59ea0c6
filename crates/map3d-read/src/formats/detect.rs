//! Detects the format of a file from its content.

use std::io::Read;
use std::path::Path;

use map3d_base::{Error, Result};

use crate::document::text_input::{open_lines, open_xml};

/// Supported formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    Obj,
    CityGml,
}

const HEAD_BYTES: u64 = 1 << 16;
/// Common OBJ keywords.
const OBJ_KEYWORDS: [&str; 14] = ["v", "vt", "vn", "vp", "f", "l", "p", "o", "g", "s", "mtllib", "usemtl", "usemap", "call"];

/// Detects the format from the first 64 KiB of a file. Returns an error if the format is not supported.
pub fn detect_format(path: &Path) -> Result<Format> {
    let mut head = Vec::new();
    open_xml(path)?.take(HEAD_BYTES).read_to_end(&mut head).map_err(|e| Error::storage(path, e))?;
    let text = String::from_utf8_lossy(&head);
    if text.trim_start_matches('\u{feff}').trim_start().starts_with('<') {
        return match find_root_name(&text) {
            Some("CityModel") => Ok(Format::CityGml),
            Some(root) => Err(Error::format(path, format!("unsupported XML root element {root:?}; expected CityModel (CityGML)"))),
            None => Err(Error::format(path, "XML document without a root element")),
        };
    }
    head.clear();
    open_lines(path)?.take(HEAD_BYTES).read_to_end(&mut head).map_err(|e| Error::storage(path, e))?;
    if is_probably_obj(&head) { Ok(Format::Obj) } else { Err(Error::format(path, "unsupported format; expected OBJ or CityGML")) }
}

/// Returns the local name of the first element.
fn find_root_name(text: &str) -> Option<&str> {
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

/// Returns true if at least 90 % of the lines that are not empty or comments begin with an OBJ keyword.
fn is_probably_obj(head: &[u8]) -> bool {
    if head.contains(&0) {
        return false;
    }
    let text = String::from_utf8_lossy(head);
    let lines: Vec<&str> = text.split(['\n', '\r']).map(str::trim).filter(|l| !l.is_empty() && !l.starts_with('#')).collect();
    let known = lines.iter().filter(|l| l.split_whitespace().next().is_some_and(|w| OBJ_KEYWORDS.contains(&w))).count();
    known > 0 && known * 10 >= lines.len() * 9
}
