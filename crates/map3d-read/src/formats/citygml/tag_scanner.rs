//! Scans the tags of a document quickly, without its text and without checks. The second pass reports malformed XML.

use std::io::{self, BufRead, Read};

use memchr::{memchr, memchr3, memmem};

use crate::document::text_input::TextInput;

const BUFFER_BYTES: usize = 1 << 17;
/// Scanning ends at a longer tag or comment.
const MAX_TAG_BYTES: usize = 1 << 24;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TagKind {
    Start,
    Empty,
    End,
    /// A document type definition.
    Doctype,
}

/// Returns the tags one after another. As a `BufRead`, continues with the current tag.
pub struct TagScanner {
    source: TextInput,
    buffer: Vec<u8>,
    start: usize,
    end: usize,
    /// Length of the current tag.
    tag_bytes: usize,
}

impl TagScanner {
    pub fn new(source: TextInput) -> Self {
        Self { source, buffer: vec![0; BUFFER_BYTES], start: 0, end: 0, tag_bytes: 0 }
    }

    /// Moves to the next tag; returns `None` at the end of the document or where it is truncated.
    pub fn next_tag(&mut self) -> io::Result<Option<TagKind>> {
        self.start += std::mem::take(&mut self.tag_bytes);
        loop {
            if !self.skip_to_tag()? {
                return Ok(None);
            }
            let head = self.peek(9)?;
            let (ending, kind): (&[u8], _) = match head {
                h if h.starts_with(b"<!--") => (b"-->", None),
                h if h.starts_with(b"<![CDATA[") => (b"]]>", None),
                h if h.starts_with(b"<?") => (b"?>", None),
                h if h.starts_with(b"<!") => return Ok(Some(TagKind::Doctype)),
                h if h.starts_with(b"</") => (b">", Some(TagKind::End)),
                _ => (b"", Some(TagKind::Start)),
            };
            let found = self.find(|bytes| match ending {
                b"" => find_tag_end(bytes),
                b">" => memchr(b'>', bytes).map(|at| at + 1),
                _ => memmem::find(bytes, ending).map(|at| at + ending.len()),
            })?;
            let Some(length) = found else { return Ok(None) };
            match kind {
                None => self.start += length,
                Some(kind) => {
                    self.tag_bytes = length;
                    let is_empty = kind == TagKind::Start && self.buffer[self.start + length - 2] == b'/';
                    return Ok(Some(if is_empty { TagKind::Empty } else { kind }));
                }
            }
        }
    }

    /// Returns the name and attributes of the current tag, without brackets.
    pub fn tag(&self) -> &[u8] {
        let tag = &self.buffer[self.start..self.start + self.tag_bytes];
        let tag = tag.strip_prefix(b"<").unwrap_or(tag);
        let tag = tag.strip_suffix(b">").unwrap_or(tag);
        tag.strip_suffix(b"/").unwrap_or(tag)
    }

    /// Moves to the next `<`; returns false at the end of the document.
    fn skip_to_tag(&mut self) -> io::Result<bool> {
        loop {
            match memchr(b'<', &self.buffer[self.start..self.end]) {
                Some(at) => {
                    self.start += at;
                    return Ok(true);
                }
                None => self.start = self.end,
            }
            if self.read_more()? == 0 {
                return Ok(false);
            }
        }
    }

    /// Returns the buffered bytes: at least `n`, unless the document ends.
    fn peek(&mut self, n: usize) -> io::Result<&[u8]> {
        while self.end - self.start < n && self.read_more()? > 0 {}
        Ok(&self.buffer[self.start..self.end])
    }

    /// Reads more bytes until `find` returns a position in the buffered bytes.
    fn find(&mut self, find: impl Fn(&[u8]) -> Option<usize>) -> io::Result<Option<usize>> {
        loop {
            if let Some(at) = find(&self.buffer[self.start..self.end]) {
                return Ok(Some(at));
            }
            if self.end - self.start > MAX_TAG_BYTES || self.read_more()? == 0 {
                return Ok(None);
            }
        }
    }

    /// Moves the buffered bytes to the front and reads more; doubles the buffer when it is full.
    fn read_more(&mut self) -> io::Result<usize> {
        self.buffer.copy_within(self.start..self.end, 0);
        (self.start, self.end) = (0, self.end - self.start);
        if self.end == self.buffer.len() {
            self.buffer.resize(2 * self.end, 0);
        }
        let n = self.source.read(&mut self.buffer[self.end..])?;
        self.end += n;
        Ok(n)
    }
}

/// Returns the position after the first `>` outside quotes.
fn find_tag_end(bytes: &[u8]) -> Option<usize> {
    let mut at = 0;
    loop {
        at += memchr3(b'>', b'"', b'\'', &bytes[at..])?;
        match bytes[at] {
            b'>' => return Some(at + 1),
            quote => at += 2 + memchr(quote, &bytes[at + 1..])?,
        }
    }
}

impl Read for TagScanner {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let n = self.fill_buf()?.read(out)?;
        self.consume(n);
        Ok(n)
    }
}

impl BufRead for TagScanner {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        self.tag_bytes = 0;
        self.peek(1)
    }

    fn consume(&mut self, n: usize) {
        self.start += n;
    }
}
