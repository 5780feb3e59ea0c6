//! A pull parser: no DTD, no entities of a document's own, bounded depth, names without namespace.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use map3d_base::{Error, Result};
use quick_xml::Reader;
use quick_xml::escape::unescape;
use quick_xml::events::attributes::Attributes;
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
pub struct Xml {
    reader: Reader<Input>,
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
        let mut reader = Reader::from_reader(open_xml(path)?);
        reader.config_mut().expand_empty_elements = true;
        Ok(Self {
            reader,
            path: path.to_path_buf(),
            buffer: Vec::new(),
            tag: String::new(),
            name_end: 0,
            local_start: 0,
            text: String::new(),
            depth: 0,
            broken: false,
        })
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
        self.local_start = self.tag[..self.name_end].rfind(':').map_or(0, |at| at + 1);
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
        if self.tag.len() <= self.name_end {
            return None;
        }
        let mut attributes = Attributes::new(&self.tag, self.name_end);
        let found = attributes.with_checks(false).flatten().find(|a| a.key.local_name().as_ref() == local && !is_declaration(a.key.as_ref()))?;
        Some(unescaped(found.value))
    }

    /// Attributes of the element that started last: name without prefix, value as written.
    pub fn attributes(&self) -> impl Iterator<Item = (&str, Cow<'_, str>)> {
        let mut attributes = Attributes::new(&self.tag, self.name_end);
        attributes.with_checks(false);
        attributes.flatten().map(|a| (a.key.local_name().into_inner(), a.value))
    }

    /// The text that was read last.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Goes on to the next child of the element that is open: true, it has started; false, the open element has ended.
    pub fn next_child(&mut self) -> Result<bool> {
        loop {
            match self.step()? {
                Step::Start => return Ok(true),
                Step::End => return Ok(false),
                Step::Text => {}
                Step::Eof => return Ok(false),
            }
        }
    }

    /// Skips the rest of the element that is open.
    pub fn skip(&mut self) -> Result<()> {
        let depth = self.depth;
        while self.depth >= depth {
            if self.step()? == Step::Eof {
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

fn is_declaration(key: &str) -> bool {
    key == "xmlns" || key.starts_with("xmlns:")
}

/// A value that cannot be unescaped is taken as it is written.
fn unescaped(value: Cow<'_, str>) -> Cow<'_, str> {
    if !value.contains('&') {
        return value;
    }
    let plain = unescape(&value).ok().map(Cow::into_owned);
    plain.map_or(value, Cow::Owned)
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

fn refused(path: &Path, what: &str) -> Error {
    Error::format(path, format!("{what} is refused; remove it and write the text itself"))
}
