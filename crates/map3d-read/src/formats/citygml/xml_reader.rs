//! A pull parser for XML without DTDs and custom entities, with bounded depth. Names come without their namespace prefix.

use std::borrow::Cow;
use std::io::BufRead;
use std::path::{Path, PathBuf};

use map3d_base::{Error, Result};
use memchr::memchr;
use quick_xml::Reader;
use quick_xml::escape::unescape;
use quick_xml::events::{BytesRef, Event};

use crate::city_model::geometry_arena::MAX_DEPTH;
use crate::city_model::ids::{self, Id, hash_id, mix_id};
use crate::document::text_input::{TextInput, open_xml};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum XmlEvent {
    Start,
    End,
    Text,
    Eof,
}

/// Reads a document event by event. The name and attributes of an element (after `XmlEvent::Start`) and the text (after `XmlEvent::Text`) are
/// valid until the next event of that type.
pub struct XmlReader<R = TextInput> {
    reader: Reader<R>,
    path: PathBuf,
    buffer: Vec<u8>,
    /// The last start tag, without its brackets.
    tag: String,
    name_end: usize,
    local_start: usize,
    text: String,
    depth: usize,
    malformed: Option<Malformed>,
    /// Mixed with the ids; see `references`.
    document_key: Id,
}

/// Where and why a document is not well-formed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Malformed {
    pub byte: u64,
    pub what: String,
}

impl XmlReader {
    pub fn open(path: &Path) -> Result<Self> {
        Ok(Self::new(open_xml(path)?, path))
    }
}

impl<R: BufRead> XmlReader<R> {
    /// The input may start anywhere between two elements. `path` is for error messages.
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
            malformed: None,
            document_key: 0,
        }
    }

    /// Mixes the ids with the key of their document.
    pub fn set_document_key(&mut self, key: Id) {
        self.document_key = key;
    }

    /// Returns the rest of the input.
    pub fn into_inner(self) -> R {
        self.reader.into_inner()
    }

    /// Returns true if the last error was malformed XML. Everything before that error is valid.
    pub fn is_malformed(&self) -> bool {
        self.malformed.is_some()
    }

    /// Returns where and why the last error found malformed XML.
    pub fn malformed(&self) -> Option<&Malformed> {
        self.malformed.as_ref()
    }

    fn malformed_error(&mut self, byte: u64, what: String) -> Error {
        let error = Error::format(&self.path, format!("malformed XML at byte {byte}: {what}"));
        self.malformed = Some(Malformed { byte, what });
        error
    }

    pub fn depth(&self) -> usize {
        self.depth
    }

    /// Returns the number of bytes read so far.
    pub fn position(&self) -> u64 {
        self.reader.buffer_position()
    }

    pub fn next_event(&mut self) -> Result<XmlEvent> {
        self.read_event::<false>()
    }

    /// Reads one event; with `SKIP_TEXT`, skips text.
    fn read_event<const SKIP_TEXT: bool>(&mut self) -> Result<XmlEvent> {
        loop {
            self.buffer.clear();
            let event = match self.reader.read_event_into(&mut self.buffer) {
                Ok(event) => event,
                Err(quick_xml::Error::Io(e)) => return Err(Error::storage(&self.path, std::io::Error::new(e.kind(), e.to_string()))),
                Err(e) => {
                    let what = e.to_string();
                    return Err(self.malformed_error(self.reader.error_position(), what));
                }
            };
            match event {
                Event::Start(e) => {
                    self.tag.clear();
                    self.tag.push_str(&e);
                    self.name_end = e.name().as_ref().len();
                    return self.start_element();
                }
                Event::End(_) => {
                    self.depth -= 1;
                    return Ok(XmlEvent::End);
                }
                Event::Text(_) | Event::CData(_) if SKIP_TEXT => {}
                Event::Text(e) => {
                    self.text.clear();
                    self.text.push_str(&e);
                    return Ok(XmlEvent::Text);
                }
                Event::CData(e) => {
                    self.text.clear();
                    self.text.push_str(&e);
                    return Ok(XmlEvent::Text);
                }
                Event::GeneralRef(e) => {
                    self.text.clear();
                    self.text.push(resolve_entity(&e).ok_or_else(|| unsupported(&self.path, &format!("the entity &{};", &*e)))?);
                    return Ok(XmlEvent::Text);
                }
                Event::DocType(_) => return Err(unsupported(&self.path, "a document type definition")),
                Event::Eof => return self.finish(),
                Event::Empty(_) | Event::Comment(_) | Event::Decl(_) | Event::PI(_) => {}
            }
        }
    }

    fn start_element(&mut self) -> Result<XmlEvent> {
        self.depth += 1;
        self.local_start = memchr(b':', &self.tag.as_bytes()[..self.name_end]).map_or(0, |at| at + 1);
        if self.depth > MAX_DEPTH {
            let (got, value) = (self.depth as u64, MAX_DEPTH as u64);
            return Err(Error::Limit { path: self.path.clone(), what: "element depth", got, limit: "XML depth", value });
        }
        Ok(XmlEvent::Start)
    }

    fn finish(&mut self) -> Result<XmlEvent> {
        if self.depth == 0 {
            return Ok(XmlEvent::Eof);
        }
        let what = format!("the document ends inside {} elements", self.depth);
        Err(self.malformed_error(self.position(), what))
    }

    /// Returns the local name of the last start tag.
    pub fn local_name(&self) -> &str {
        &self.tag[self.local_start..self.name_end]
    }

    /// Returns the first attribute of the last start tag with this local name.
    pub fn attribute(&self, local_name: &str) -> Option<Cow<'_, str>> {
        self.attributes().find(|(name, _)| *name == local_name).map(|(_, value)| unescape_lossy(value))
    }

    /// Returns the hashed gml:id of the last start tag, or `ids::NONE`.
    pub fn gml_id(&self) -> Id {
        self.attribute("id").map_or(ids::NONE, |id| mix_id(hash_id(&id), self.document_key))
    }

    /// Iterates over the attributes of the last start tag; see `parse_attributes`.
    pub fn attributes(&self) -> impl Iterator<Item = (&str, &str)> {
        parse_attributes(&self.tag[self.name_end..])
    }

    /// Returns the last text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Returns the next event that is not text. Custom entities in the skipped text are an error too.
    pub fn next_tag(&mut self) -> Result<XmlEvent> {
        loop {
            let event = self.read_event::<true>()?;
            if event != XmlEvent::Text {
                return Ok(event);
            }
        }
    }

    /// Moves to the next child of the current element; returns false at the end of the current element.
    pub fn next_child(&mut self) -> Result<bool> {
        loop {
            match self.read_event::<true>()? {
                XmlEvent::Start => return Ok(true),
                XmlEvent::End | XmlEvent::Eof => return Ok(false),
                XmlEvent::Text => {}
            }
        }
    }

    /// Skips the rest of the current element.
    pub fn skip(&mut self) -> Result<()> {
        let depth = self.depth;
        while self.depth >= depth {
            if self.read_event::<true>()? == XmlEvent::Eof {
                break;
            }
        }
        Ok(())
    }

    /// Reads the current element to its end and appends its text, including that of nested elements.
    pub fn append_text(&mut self, out: &mut String) -> Result<()> {
        let depth = self.depth;
        while self.depth >= depth {
            match self.next_event()? {
                XmlEvent::Text => out.push_str(&self.text),
                XmlEvent::Eof => break,
                XmlEvent::Start | XmlEvent::End => {}
            }
        }
        Ok(())
    }

    /// Reads the current element to its end and returns its text, trimmed.
    pub fn read_text(&mut self) -> Result<String> {
        let mut text = String::new();
        self.append_text(&mut text)?;
        Ok(text.trim().to_owned())
    }
}

/// Parses the part of a start tag after its name into pairs of local name and raw value. Skips namespace declarations.
pub fn parse_attributes(mut rest: &str) -> impl Iterator<Item = (&str, &str)> {
    std::iter::from_fn(move || {
        let (name, after) = rest.split_at_checked(memchr(b'=', rest.as_bytes())?)?;
        let after = after[1..].trim_ascii_start();
        let quote = *after.as_bytes().first().filter(|c| matches!(c, b'"' | b'\''))?;
        let end = 1 + memchr(quote, &after.as_bytes()[1..])?;
        rest = &after[end + 1..];
        Some((name.trim_ascii(), &after[1..end]))
    })
    .filter(|(name, _)| !name.starts_with("xmlns"))
    .map(|(name, value)| (local_part(name), value))
}

/// Returns a qualified name without its prefix.
pub fn local_part(name: &str) -> &str {
    memchr(b':', name.as_bytes()).map_or(name, |at| &name[at + 1..])
}

/// Unescapes a value; returns it unchanged if it contains an unknown entity.
pub fn unescape_lossy(value: &str) -> Cow<'_, str> {
    unescape(value).unwrap_or(Cow::Borrowed(value))
}

/// Resolves a character reference or one of the five predefined entities.
fn resolve_entity(reference: &BytesRef) -> Option<char> {
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

/// Returns the error for an XML feature that is not read because it is unsafe.
pub fn unsupported(path: &Path, what: &str) -> Error {
    Error::format(path, format!("{what} is not allowed; remove it and write its text inline"))
}
