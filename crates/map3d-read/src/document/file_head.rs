//! The beginning of a file, by which its format is detected.

use std::path::Path;

use encoding_rs::UTF_8;
use map3d_base::Result;

use super::text_input::{find_utf16, read_file_head};

/// Length of the beginning.
pub const HEAD_BYTES: usize = 1 << 16;

/// The first bytes of a file or, of one packed with gzip, of its content.
pub struct FileHead {
    pub bytes: Vec<u8>,
    text: String,
}

impl FileHead {
    /// `bytes`: the first `HEAD_BYTES`, or all.
    pub fn new(bytes: Vec<u8>) -> Self {
        // Names of elements and keywords are ASCII: of other encodings, only UTF-16 matters.
        let text = find_utf16(&bytes).unwrap_or(UTF_8).decode(&bytes).0.trim_start().to_owned();
        Self { bytes, text }
    }

    /// Reads the beginning of a regular file.
    pub fn read(path: &Path) -> Result<Self> {
        Ok(Self::new(read_file_head(path, HEAD_BYTES)?))
    }

    /// Returns the text, without white space before it.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Returns true for text that begins as XML does.
    pub fn is_xml(&self) -> bool {
        self.text.starts_with('<')
    }

    /// Returns the local name of the first element of an XML document.
    pub fn xml_root(&self) -> Option<&str> {
        let mut rest = Some(&*self.text).filter(|_| self.is_xml())?;
        loop {
            rest = &rest[rest.find('<')? + 1..];
            if let Some(comment) = rest.strip_prefix("!--") {
                rest = &comment[comment.find("-->")?..];
            } else if !rest.starts_with(['!', '?']) {
                let name = rest.split(|c: char| !c.is_alphanumeric() && !"_-.:".contains(c)).next()?;
                return name.rsplit(':').next().filter(|name| !name.is_empty());
            }
        }
    }

    /// Returns the lines of a text that are whole, trimmed; of a file that is not text, none.
    pub fn lines(&self) -> impl Iterator<Item = &str> {
        let text = if self.text.contains('\0') { "" } else { &*self.text };
        let is_cut = self.bytes.len() >= HEAD_BYTES;
        let whole = if is_cut { text.rfind(['\n', '\r']).map_or(text, |end| &text[..end]) } else { text };
        whole.split(['\n', '\r']).map(str::trim)
    }
}
