//! Logical lines of OBJ and MTL: any line end, a backslash at the end joins the next line.

use std::io::BufRead;
use std::path::{Path, PathBuf};

use map3d_base::{Error, Result};

use crate::text::{Input, open_lines};

const MAX_LINE_BYTES: usize = 16 << 20;

pub struct Lines {
    input: Input,
    path: PathBuf,
    line: Vec<u8>,
    /// Of the line that was read last, from 1.
    pub number: u64,
}

impl Lines {
    pub fn open(path: &Path) -> Result<Self> {
        Ok(Self { input: open_lines(path)?, path: path.to_path_buf(), line: Vec::new(), number: 0 })
    }

    /// The next line, without its end.
    pub fn next_line(&mut self) -> Result<Option<&[u8]>> {
        self.line.clear();
        let mut any = false;
        while self.append_physical()? {
            any = true;
            self.number += 1;
            if self.line.last() != Some(&b'\\') {
                break;
            }
            *self.line.last_mut().expect("a backslash") = b' ';
        }
        Ok(any.then_some(&self.line))
    }

    /// False at the end of the file. An empty line between CR and LF is no line of its own use, and harmless.
    fn append_physical(&mut self) -> Result<bool> {
        let mut any = false;
        loop {
            let buffer = self.input.fill_buf().map_err(|e| Error::storage(&self.path, e))?;
            if buffer.is_empty() {
                return Ok(any);
            }
            any = true;
            let end = memchr::memchr2(b'\n', b'\r', buffer);
            let taken = end.unwrap_or(buffer.len());
            self.line.extend_from_slice(&buffer[..taken]);
            let crlf = end.is_some() && buffer[taken] == b'\r';
            self.input.consume(taken + usize::from(end.is_some()));
            if crlf {
                self.drop_line_feed()?;
            }
            if end.is_some() {
                return Ok(true);
            }
            if self.line.len() > MAX_LINE_BYTES {
                let (got, value) = (self.line.len() as u64, MAX_LINE_BYTES as u64);
                return Err(Error::Limit { path: self.path.clone(), what: "length of a line", got, limit: "bytes per line", value });
            }
        }
    }

    fn drop_line_feed(&mut self) -> Result<()> {
        let buffer = self.input.fill_buf().map_err(|e| Error::storage(&self.path, e))?;
        if buffer.first() == Some(&b'\n') {
            self.input.consume(1);
        }
        Ok(())
    }
}

/// First word of a line and the rest of it, both trimmed.
pub fn split_word(line: &[u8]) -> (&[u8], &[u8]) {
    let line = line.trim_ascii();
    let end = line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len());
    (&line[..end], line[end..].trim_ascii())
}

/// Words of a line up to a comment.
pub fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty()).take_while(|w| w[0] != b'#')
}

/// Numbers of a line up to the first word that is none.
pub fn numbers(line: &[u8]) -> impl Iterator<Item = f64> {
    words(line).map_while(number)
}

/// A decimal number; some writers put a comma where the point belongs.
pub fn number(word: &[u8]) -> Option<f64> {
    fast_float2::parse(word).ok().or_else(|| {
        let text = std::str::from_utf8(word).ok()?;
        (text.matches(',').count() == 1).then(|| text.replace(',', ".").parse().ok())?
    })
}
