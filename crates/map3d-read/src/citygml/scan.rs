//! A quick look at the tags of a document, without its text and without checks: what is not well-formed is found in the second pass.

use std::io::{self, BufRead, Read};

use memchr::{memchr, memchr3, memmem};

use crate::text::Input;

const BUFFER_BYTES: usize = 1 << 17;
/// A longer tag or comment is not looked at; the second pass meets it too.
const MAX_TAG_BYTES: usize = 1 << 24;

/// What was found. The text of a start tag is at hand until the next step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tag {
    Start,
    Empty,
    End,
    /// A document type definition.
    Doctype,
}

/// Tags one after the other. Reading on from it (`BufRead`) begins at the tag that was found last, itself included.
pub struct Scanner {
    source: Input,
    buffer: Vec<u8>,
    start: usize,
    end: usize,
    /// Bytes of the tag that was found last.
    tag_bytes: usize,
}

impl Scanner {
    pub fn new(source: Input) -> Self {
        Self { source, buffer: vec![0; BUFFER_BYTES], start: 0, end: 0, tag_bytes: 0 }
    }

    /// The next tag; `None` at the end of the document (or where it breaks off).
    pub fn next_tag(&mut self) -> io::Result<Option<Tag>> {
        self.start += std::mem::take(&mut self.tag_bytes);
        loop {
            if !self.skip_to_tag()? {
                return Ok(None);
            }
            let head = self.at_least(9)?;
            let (ending, tag): (&[u8], _) = match head {
                h if h.starts_with(b"<!--") => (b"-->", None),
                h if h.starts_with(b"<![CDATA[") => (b"]]>", None),
                h if h.starts_with(b"<?") => (b"?>", None),
                h if h.starts_with(b"<!") => return Ok(Some(Tag::Doctype)),
                h if h.starts_with(b"</") => (b">", Some(Tag::End)),
                _ => (b"", Some(Tag::Start)),
            };
            let found = self.find(|bytes| match ending {
                b"" => end_of_tag(bytes),
                b">" => memchr(b'>', bytes).map(|at| at + 1),
                _ => memmem::find(bytes, ending).map(|at| at + ending.len()),
            })?;
            let Some(length) = found else { return Ok(None) };
            match tag {
                None => self.start += length,
                Some(tag) => {
                    self.tag_bytes = length;
                    let empty = tag == Tag::Start && self.buffer[self.start + length - 2] == b'/';
                    return Ok(Some(if empty { Tag::Empty } else { tag }));
                }
            }
        }
    }

    /// What stands between the brackets of the start tag that was found last: name and attributes.
    pub fn tag(&self) -> &[u8] {
        let tag = &self.buffer[self.start..self.start + self.tag_bytes];
        let tag = tag.strip_prefix(b"<").unwrap_or(tag);
        let tag = tag.strip_suffix(b">").unwrap_or(tag);
        tag.strip_suffix(b"/").unwrap_or(tag)
    }

    /// Puts a `<` at the beginning of the buffer; false at the end of the document.
    fn skip_to_tag(&mut self) -> io::Result<bool> {
        loop {
            match memchr(b'<', &self.buffer[self.start..self.end]) {
                Some(at) => {
                    self.start += at;
                    return Ok(true);
                }
                None => self.start = self.end,
            }
            if self.more()? == 0 {
                return Ok(false);
            }
        }
    }

    /// The bytes at hand, this many if the document has them.
    fn at_least(&mut self, n: usize) -> io::Result<&[u8]> {
        while self.end - self.start < n && self.more()? > 0 {}
        Ok(&self.buffer[self.start..self.end])
    }

    /// Reads on until `find` finds something in the bytes at hand.
    fn find(&mut self, find: impl Fn(&[u8]) -> Option<usize>) -> io::Result<Option<usize>> {
        loop {
            if let Some(at) = find(&self.buffer[self.start..self.end]) {
                return Ok(Some(at));
            }
            if self.end - self.start > MAX_TAG_BYTES || self.more()? == 0 {
                return Ok(None);
            }
        }
    }

    /// Reads more behind the bytes at hand, which move to the front; the buffer grows when they fill it.
    fn more(&mut self) -> io::Result<usize> {
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

/// Behind the `>` that is not in quotes.
fn end_of_tag(bytes: &[u8]) -> Option<usize> {
    let mut at = 0;
    loop {
        at += memchr3(b'>', b'"', b'\'', &bytes[at..])?;
        match bytes[at] {
            b'>' => return Some(at + 1),
            quote => at += 2 + memchr(quote, &bytes[at + 1..])?,
        }
    }
}

impl Read for Scanner {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let n = self.fill_buf()?.read(out)?;
        self.consume(n);
        Ok(n)
    }
}

impl BufRead for Scanner {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        self.tag_bytes = 0;
        self.at_least(1)
    }

    fn consume(&mut self, n: usize) {
        self.start += n;
    }
}
