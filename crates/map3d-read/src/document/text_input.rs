//! Opens text files in any encoding and reads them as UTF-8.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1252};
use encoding_rs_io::{DecodeReaderBytes, DecodeReaderBytesBuilder};
use map3d_base::{Error, Reason, Result};
use memchr::{memchr, memchr_iter};

use super::byte_source::ByteSource;
use super::lossy_utf8::LossyUtf8;

const ENCODING_BYTES: usize = 4096;
const BUFFER_BYTES: usize = 1 << 17;

/// A text file, read as it is or decoded to UTF-8.
pub enum TextInput {
    Plain(BufReader<ByteSource>),
    Decoded(Box<BufReader<DecodeReaderBytes<ByteSource, Vec<u8>>>>),
    Lossy(Box<BufReader<LossyUtf8<ByteSource>>>),
}

/// Something wrong with the encoding of a document: a reason and an example, as in a report.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EncodingFault {
    pub reason: Reason,
    pub example: String,
}

impl Read for TextInput {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Plain(input) => input.read(out),
            Self::Decoded(input) => input.read(out),
            Self::Lossy(input) => input.read(out),
        }
    }
}

impl BufRead for TextInput {
    #[inline]
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        match self {
            Self::Plain(input) => input.fill_buf(),
            Self::Decoded(input) => input.fill_buf(),
            Self::Lossy(input) => input.fill_buf(),
        }
    }

    #[inline]
    fn consume(&mut self, n: usize) {
        match self {
            Self::Plain(input) => input.consume(n),
            Self::Decoded(input) => input.consume(n),
            Self::Lossy(input) => input.consume(n),
        }
    }
}

/// Opens a regular file. Opening a named pipe would wait for its writer.
fn open_file(path: &Path) -> Result<ByteSource> {
    if !path.metadata().map_err(|e| Error::storage(path, e))?.is_file() {
        return Err(Error::format(path, "not a regular file"));
    }
    File::open(path).and_then(ByteSource::new).map_err(|e| Error::storage(path, e))
}

/// Returns the first bytes of a file or, if it is packed, of its content.
pub fn read_file_head(path: &Path, size: usize) -> Result<Vec<u8>> {
    read_head(&mut open_file(path)?, size).map_err(|e| Error::storage(path, e))
}

/// Returns the first bytes of a file and rewinds it.
fn read_head(file: &mut ByteSource, size: usize) -> io::Result<Vec<u8>> {
    let mut head = Vec::new();
    let read = file.by_ref().take(size as u64).read_to_end(&mut head);
    // What precedes the damage of a short gzip file is its head.
    read.or_else(|e| if file.is_gzip() { Ok(0) } else { Err(e) })?;
    file.rewind()?;
    Ok(head)
}

/// Opens an XML document. The byte order mark or the XML declaration gives the encoding; bytes that are not UTF-8 in a document that should be
/// are read as Windows-1252.
pub fn open_xml(path: &Path) -> Result<TextInput> {
    Ok(open_checked_xml(path)?.0)
}

/// Opens an XML document; returns also what is wrong with its encoding.
pub fn open_checked_xml(path: &Path) -> Result<(TextInput, Vec<EncodingFault>)> {
    let io = |e| Error::storage(path, e);
    let mut file = open_file(path)?;
    let head = read_head(&mut file, ENCODING_BYTES).map_err(io)?;
    let mut faults = Vec::new();
    let declared = find_declared_encoding(&head);
    let known = declared.as_deref().and_then(|name| Encoding::for_label(name.as_bytes()));
    if let (Some(name), None) = (declared, known) {
        faults.push(EncodingFault { reason: Reason::EncodingUnknown, example: name });
    }
    let encoding = detect_utf16_without_bom(&head).or(known).unwrap_or(UTF_8);
    if encoding != UTF_8 || Encoding::for_bom(&head).is_some() {
        return Ok((decode(file, encoding), faults));
    }
    match find_utf8_fault(&mut file).map_err(io)? {
        None => Ok((TextInput::Plain(BufReader::with_capacity(BUFFER_BYTES, file)), faults)),
        Some(fault) => {
            faults.push(fault);
            Ok((TextInput::Lossy(Box::new(BufReader::with_capacity(BUFFER_BYTES, LossyUtf8::new(file)))), faults))
        }
    }
}

/// Returns the number of the line that contains a byte of an XML document.
pub fn count_lines(path: &Path, byte: u64) -> Result<u64> {
    let io = |e| Error::storage(path, e);
    let mut input = open_xml(path)?.take(byte);
    let mut line = 1;
    loop {
        let buffer = input.fill_buf().map_err(io)?;
        if buffer.is_empty() {
            return Ok(line);
        }
        line += memchr_iter(b'\n', buffer).count() as u64;
        let n = buffer.len();
        input.consume(n);
    }
}

/// Finds the first byte of the file that is zero or not UTF-8, or that cannot be unpacked: then the file ends there. Rewinds the file.
fn find_utf8_fault(file: &mut ByteSource) -> io::Result<Option<EncodingFault>> {
    let mut buffer = vec![0; BUFFER_BYTES];
    let (mut kept, mut position) = (0, 0);
    let fault = loop {
        let n = match file.read(&mut buffer[kept..]) {
            Err(_) if file.is_gzip() => {
                let example = format!("after {} unpacked bytes", file.end_at_damage());
                break Some(EncodingFault { reason: Reason::GzipDamaged, example });
            }
            read => read?,
        };
        let bytes = &buffer[..kept + n];
        if let Some(at) = memchr(0, bytes) {
            break Some(EncodingFault { reason: Reason::ZeroBytesLeftOut, example: format!("byte {}", position + at as u64) });
        }
        match std::str::from_utf8(bytes) {
            Ok(_) if n == 0 => break None,
            Ok(_) => {
                position += bytes.len() as u64;
                kept = 0;
            }
            // The end of the buffer may split a character.
            Err(e) if e.error_len().is_none() && n > 0 => {
                let end = kept + n;
                buffer.copy_within(e.valid_up_to()..end, 0);
                position += e.valid_up_to() as u64;
                kept = end - e.valid_up_to();
            }
            Err(e) => {
                let example = format!("byte {}", position + e.valid_up_to() as u64);
                break Some(EncodingFault { reason: Reason::NotUtf8AsDeclared, example });
            }
        }
    };
    file.rewind()?;
    Ok(fault)
}

/// Opens a text file for reading by lines. UTF-16 is decoded; other encodings pass through, without a byte order mark (see `decode_name`).
pub fn open_lines(path: &Path) -> Result<TextInput> {
    let mut file = open_file(path)?;
    let head = read_head(&mut file, ENCODING_BYTES).map_err(|e| Error::storage(path, e))?;
    if let Some(encoding) = find_utf16(&head) {
        return Ok(decode(file, encoding));
    }
    let mut input = BufReader::with_capacity(BUFFER_BYTES, file);
    if Encoding::for_bom(&head).is_some() {
        input.fill_buf().map_err(|e| Error::storage(path, e))?;
        input.consume(3);
    }
    Ok(TextInput::Plain(input))
}

/// Decodes a name as UTF-8 or, where that fails, as Windows-1252.
pub fn decode_name(bytes: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => WINDOWS_1252.decode_without_bom_handling(bytes).0,
    }
}

fn decode(file: ByteSource, encoding: &'static Encoding) -> TextInput {
    let decoder = DecodeReaderBytesBuilder::new().encoding(Some(encoding)).bom_override(true).build(file);
    TextInput::Decoded(Box::new(BufReader::with_capacity(BUFFER_BYTES, decoder)))
}

/// Returns the UTF-16 that a byte order mark or zeros announce.
pub fn find_utf16(head: &[u8]) -> Option<&'static Encoding> {
    let marked = Encoding::for_bom(head).map(|(encoding, _)| encoding).filter(|encoding| *encoding != UTF_8);
    marked.or_else(|| detect_utf16_without_bom(head))
}

/// Detects UTF-16 by its zeros: an ASCII character has one in one of its two bytes, and other alphabets have few. XML shows by its first characters.
fn detect_utf16_without_bom(head: &[u8]) -> Option<&'static Encoding> {
    let pairs = head.as_chunks::<2>().0;
    if pairs.len() < 2 || Encoding::for_bom(head).is_some() {
        return None;
    }
    let zeros = |k: usize| pairs.iter().filter(|p| p[k] == 0).count();
    let begins_as_xml = |k: usize| {
        let mut ascii = pairs.iter().map(|p| (p[k] == 0).then_some(p[1 - k])).skip_while(|c| c.is_some_and(|c| c.is_ascii_whitespace()));
        ascii.next() == Some(Some(b'<')) && ascii.next().flatten().is_some_and(|c| c.is_ascii_graphic())
    };
    let is_mostly = |k: usize| zeros(k) >= 2 && zeros(k) * 4 > pairs.len() && zeros(1 - k) * 16 < zeros(k);
    let has_high_zeros = |k: usize| begins_as_xml(k) || is_mostly(k);
    match (has_high_zeros(1), has_high_zeros(0)) {
        (true, false) => Some(UTF_16LE),
        (false, true) => Some(UTF_16BE),
        _ => None,
    }
}

/// Returns the name of the encoding in the XML declaration.
fn find_declared_encoding(head: &[u8]) -> Option<String> {
    let text = String::from_utf8_lossy(&head[..head.len().min(256)]);
    let declaration = &text[text.find("<?xml")?..text.find("?>")?];
    let value = declaration.split_once("encoding")?.1.trim_start().strip_prefix('=')?.trim_start();
    let quote = value.chars().next().filter(|c| "\"'".contains(*c))?;
    Some(value[1..].split(quote).next()?.to_owned())
}
