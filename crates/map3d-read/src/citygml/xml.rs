//! A pull parser: no DTD, no entities of a document's own, bounded depth, names without namespace.

use std::borrow::Cow;
use std::io::BufRead;
use std::path::{Path, PathBuf};

use map3d_base::{Error, Result};
use memchr::memchr;
use quick_xml::Reader;
use quick_xml::escape::unescape;
use quick_xml::events::{BytesRef, Event};

use crate::text::{Input, open_xml};

pub const MAX_DEPTH: usize = 256;

/// What comes next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    Start,
    End,
    Text,
    Eof,
}

/// A document being read. After `Step::Start` the element's name and attributes are at hand, after `Step::Text` the text, until the next step.
pub struct Xml<R = Input> {
    reader: Reader<R>,
    path: PathBuf,
    buffer: Vec<u8>,
    tag: String,
    name_end: usize,
    local_start: usize,
    text: String,
    depth: usize,
    broken: bool,
}

impl Xml {
    pub fn open(path: &Path) -> Result<Self> {
        Ok(Self::new(open_xml(path)?, path))
    }
}

impl<R: BufRead> Xml<R> {
    /// Reads from anywhere between two elements; `path` is for messages.
    pub fn new(input: R, path: &Path) -> Self {
        let mut reader = Reader::from_reader(input);
        reader.config_mut().expand_empty_elements = true;
        Self {
            reader,
            path: path.to_path_buf(),
            buffer: Vec::new(),
            tag: String::new(),
            name_end: 0,
            local_start: 0,
            text: String::new(),
            depth: 0,
            broken: false,
        }
    }

    /// What has not been read.
    pub fn into_inner(self) -> R {
        self.reader.into_inner()
    }

    /// The last error was that the document is not well-formed from here on; what came before is sound.
    pub fn is_broken(&self) -> bool {
        self.broken
    }

    pub fn depth(&self) -> usize {
        self.depth
    }

    /// Bytes of text read so far.
    pub fn position(&self) -> u64 {
        self.reader.buffer_position()
    }

    pub fn step(&mut self) -> Result<Step> {
        self.step_over::<false>()
    }

    /// One step; with `BARE`, text is passed over.
    fn step_over<const BARE: bool>(&mut self) -> Result<Step> {
        loop {
            self.buffer.clear();
            let event = match self.reader.read_event_into(&mut self.buffer) {
                Ok(event) => event,
                Err(quick_xml::Error::Io(e)) => return Err(Error::storage(&self.path, std::io::Error::new(e.kind(), e.to_string()))),
                Err(e) => {
                    self.broken = true;
                    return Err(Error::format(&self.path, format!("not well-formed at byte {}: {e}", self.reader.error_position())));
                }
            };
            match event {
                Event::Start(e) => {
                    self.tag.clear();
                    self.tag.push_str(&e);
                    self.name_end = e.name().as_ref().len();
                    return self.enter();
                }
                Event::End(_) => {
                    self.depth -= 1;
                    return Ok(Step::End);
                }
                Event::Text(_) | Event::CData(_) if BARE => {}
                Event::Text(e) => {
                    self.text.clear();
                    self.text.push_str(&e);
                    return Ok(Step::Text);
                }
                Event::CData(e) => {
                    self.text.clear();
                    self.text.push_str(&e);
                    return Ok(Step::Text);
                }
                Event::GeneralRef(e) => {
                    self.text.clear();
                    self.text.push(resolved(&e).ok_or_else(|| refused(&self.path, &format!("entity &{};", &*e)))?);
                    return Ok(Step::Text);
                }
                Event::DocType(_) => return Err(refused(&self.path, "a document type definition")),
                Event::Eof => return self.end(),
                Event::Empty(_) | Event::Comment(_) | Event::Decl(_) | Event::PI(_) => {}
            }
        }
    }

    fn enter(&mut self) -> Result<Step> {
        self.depth += 1;
        self.local_start = memchr(b':', &self.tag.as_bytes()[..self.name_end]).map_or(0, |at| at + 1);
        if self.depth > MAX_DEPTH {
            let (got, value) = (self.depth as u64, MAX_DEPTH as u64);
            return Err(Error::Limit { path: self.path.clone(), what: "depth of elements", got, limit: "XML depth", value });
        }
        Ok(Step::Start)
    }

    fn end(&mut self) -> Result<Step> {
        if self.depth == 0 {
            return Ok(Step::Eof);
        }
        self.broken = true;
        Err(Error::format(&self.path, format!("truncated: {} elements are still open at byte {}", self.depth, self.position())))
    }

    /// Name of the element that started last, without its prefix.
    pub fn local(&self) -> &str {
        &self.tag[self.local_start..self.name_end]
    }

    /// An attribute of the element that started last, by its name without prefix; the first of that name.
    pub fn attribute(&self, local: &str) -> Option<Cow<'_, str>> {
        self.attributes().find(|(name, _)| *name == local).map(|(_, value)| unescaped(value))
    }

    /// Attributes of the element that started last: name without prefix, value as written. Declarations of namespaces are left out.
    pub fn attributes(&self) -> impl Iterator<Item = (&str, &str)> {
        attributes(&self.tag[self.name_end..])
    }

    /// The text that was read last.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The next start or end of an element, or the end of the document; text is passed over (entities of the document's own are refused there too).
    pub fn next_tag(&mut self) -> Result<Step> {
        loop {
            let step = self.step_over::<true>()?;
            if step != Step::Text {
                return Ok(step);
            }
        }
    }

    /// Goes on to the next child of the element that is open: true, it has started; false, the open element has ended.
    pub fn next_child(&mut self) -> Result<bool> {
        loop {
            match self.step_over::<true>()? {
                Step::Start => return Ok(true),
                Step::End | Step::Eof => return Ok(false),
                Step::Text => {}
            }
        }
    }

    /// Skips the rest of the element that is open.
    pub fn skip(&mut self) -> Result<()> {
        let depth = self.depth;
        while self.depth >= depth {
            if self.step_over::<true>()? == Step::Eof {
                break;
            }
        }
        Ok(())
    }

    /// Reads the open element to its end; appends its text, that of elements inside it too.
    pub fn append_text(&mut self, out: &mut String) -> Result<()> {
        let depth = self.depth;
        while self.depth >= depth {
            match self.step()? {
                Step::Text => out.push_str(&self.text),
                Step::Eof => break,
                Step::Start | Step::End => {}
            }
        }
        Ok(())
    }

    /// The open element's text, trimmed.
    pub fn whole_text(&mut self) -> Result<String> {
        let mut text = String::new();
        self.append_text(&mut text)?;
        Ok(text.trim().to_owned())
    }
}

/// Attributes in the text behind a tag's name: name without prefix, value as written. Declarations of namespaces are left out.
pub fn attributes(mut rest: &str) -> impl Iterator<Item = (&str, &str)> {
    std::iter::from_fn(move || {
        let (name, after) = rest.split_at_checked(memchr(b'=', rest.as_bytes())?)?;
        let after = after[1..].trim_ascii_start();
        let quote = *after.as_bytes().first().filter(|c| matches!(c, b'"' | b'\''))?;
        let end = 1 + memchr(quote, &after.as_bytes()[1..])?;
        rest = &after[end + 1..];
        Some((name.trim_ascii(), &after[1..end]))
    })
    .filter(|(name, _)| !name.starts_with("xmlns"))
    .map(|(name, value)| (local_name(name), value))
}

/// A name without its prefix.
pub fn local_name(name: &str) -> &str {
    memchr(b':', name.as_bytes()).map_or(name, |at| &name[at + 1..])
}

/// A value that cannot be unescaped is taken as it is written.
pub fn unescaped(value: &str) -> Cow<'_, str> {
    unescape(value).unwrap_or(Cow::Borrowed(value))
}

/// A character reference or one of the five entities of XML itself.
fn resolved(reference: &BytesRef) -> Option<char> {
    if reference.is_char_ref() {
        return reference.resolve_char_ref().ok().flatten();
    }
    Some(match &**reference {
        "lt" => '<',
        "gt" => '>',
        "amp" => '&',
        "apos" => '\'',
        "quot" => '"',
        _ => return None,
    })
}

pub fn refused(path: &Path, what: &str) -> Error {
    Error::format(path, format!("{what} is refused; remove it and write the text itself"))
}
