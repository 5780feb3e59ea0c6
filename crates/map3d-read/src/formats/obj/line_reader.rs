//! Reads logical lines of OBJ and MTL files. Accepts any line end; a backslash at the end of a line joins the next one.

use std::io::BufRead;
use std::path::{Path, PathBuf};

use map3d_base::{Error, Result};

use crate::document::text_input::{TextInput, open_lines};

const MAX_LINE_BYTES: usize = 16 << 20;

pub struct LineReader {
    input: TextInput,
    path: PathBuf,
    line: Vec<u8>,
    /// Number of the current line, from 1.
    pub line_number: u64,
}

impl LineReader {
    pub fn open(path: &Path) -> Result<Self> {
        Ok(Self { input: open_lines(path)?, path: path.to_path_buf(), line: Vec::new(), line_number: 0 })
    }

    /// Returns the next logical line, without its line end.
    pub fn next_line(&mut self) -> Result<Option<&[u8]>> {
        self.line.clear();
        let mut found = false;
        while self.append_physical_line()? {
            found = true;
            self.line_number += 1;
            if self.line.last() != Some(&b'\\') {
                break;
            }
            *self.line.last_mut().expect("a backslash") = b' ';
        }
        Ok(found.then_some(&self.line))
    }

    /// Appends a physical line to the buffer; returns false at the end of the file.
    fn append_physical_line(&mut self) -> Result<bool> {
        let mut found = false;
        loop {
            let buffer = self.input.fill_buf().map_err(|e| Error::storage(&self.path, e))?;
            if buffer.is_empty() {
                return Ok(found);
            }
            found = true;
            let end = memchr::memchr2(b'\n', b'\r', buffer);
            let taken = end.unwrap_or(buffer.len());
            self.line.extend_from_slice(&buffer[..taken]);
            let is_return = end.is_some() && buffer[taken] == b'\r';
            self.input.consume(taken + usize::from(end.is_some()));
            if is_return {
                self.skip_line_feed()?;
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

    /// Skips the line feed of a CR LF pair.
    fn skip_line_feed(&mut self) -> Result<()> {
        let buffer = self.input.fill_buf().map_err(|e| Error::storage(&self.path, e))?;
        if buffer.first() == Some(&b'\n') {
            self.input.consume(1);
        }
        Ok(())
    }
}

/// Splits a line into its first word and the rest, both trimmed.
pub fn split_word(line: &[u8]) -> (&[u8], &[u8]) {
    let line = line.trim_ascii();
    let end = line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len());
    (&line[..end], line[end..].trim_ascii())
}

/// Iterates over the words of a line, up to a comment.
pub fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty()).take_while(|w| w[0] != b'#')
}

/// Iterates over the numbers of a line, up to the first word that is not a number.
pub fn numbers(line: &[u8]) -> impl Iterator<Item = f64> {
    words(line).map_while(parse_number)
}

/// Parses a decimal number; accepts a comma as decimal separator, which some writers produce.
pub fn parse_number(word: &[u8]) -> Option<f64> {
    fast_float2::parse(word).ok().or_else(|| {
        let text = std::str::from_utf8(word).ok()?;
        (text.matches(',').count() == 1).then(|| text.replace(',', ".").parse().ok())?
    })
}
