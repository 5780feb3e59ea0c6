//! Opens text files in any encoding and reads them as UTF-8.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek};
use std::path::Path;

use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1252};
use encoding_rs_io::{DecodeReaderBytes, DecodeReaderBytesBuilder};
use map3d_base::{Error, Result};

const HEAD_BYTES: u64 = 4096;
const BUFFER_BYTES: usize = 1 << 17;

/// A text file, read as it is or decoded to UTF-8.
pub enum TextInput {
    Plain(BufReader<File>),
    Decoded(Box<BufReader<DecodeReaderBytes<File, Vec<u8>>>>),
}

impl Read for TextInput {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Plain(input) => input.read(out),
            Self::Decoded(input) => input.read(out),
        }
    }
}

impl BufRead for TextInput {
    #[inline]
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        match self {
            Self::Plain(input) => input.fill_buf(),
            Self::Decoded(input) => input.fill_buf(),
        }
    }

    #[inline]
    fn consume(&mut self, n: usize) {
        match self {
            Self::Plain(input) => input.consume(n),
            Self::Decoded(input) => input.consume(n),
        }
    }
}

/// Opens a regular file.
fn open_file(path: &Path) -> Result<File> {
    let file = File::open(path).map_err(|e| Error::storage(path, e))?;
    let is_file = file.metadata().map_err(|e| Error::storage(path, e))?.is_file();
    if is_file { Ok(file) } else { Err(Error::format(path, "not a regular file")) }
}

/// Returns the first bytes of a file and rewinds it.
fn read_head(file: &mut File) -> io::Result<Vec<u8>> {
    let mut head = Vec::new();
    file.by_ref().take(HEAD_BYTES).read_to_end(&mut head)?;
    file.rewind()?;
    Ok(head)
}

/// Opens an XML document. The byte order mark or the XML declaration gives the encoding; invalid bytes become U+FFFD.
pub fn open_xml(path: &Path) -> Result<TextInput> {
    let io = |e| Error::storage(path, e);
    let mut file = open_file(path)?;
    let head = read_head(&mut file).map_err(io)?;
    let encoding = detect_utf16_without_bom(&head).or_else(|| parse_declared_encoding(&head)).unwrap_or(UTF_8);
    if encoding == UTF_8 && Encoding::for_bom(&head).is_none() && is_utf8(&mut file).map_err(io)? {
        return Ok(TextInput::Plain(BufReader::with_capacity(BUFFER_BYTES, file)));
    }
    Ok(decode(file, encoding))
}

/// Returns true if the whole file is valid UTF-8 and needs no decoding. Rewinds the file.
fn is_utf8(file: &mut File) -> io::Result<bool> {
    let mut buffer = vec![0; BUFFER_BYTES];
    let mut kept = 0;
    let valid = loop {
        let n = file.read(&mut buffer[kept..])?;
        match std::str::from_utf8(&buffer[..kept + n]) {
            Ok(_) if n == 0 => break true,
            Ok(_) => kept = 0,
            // The end of the buffer may split a character.
            Err(e) if e.error_len().is_none() && n > 0 => {
                buffer.copy_within(e.valid_up_to()..kept + n, 0);
                kept = kept + n - e.valid_up_to();
            }
            Err(_) => break false,
        }
    };
    file.rewind()?;
    Ok(valid)
}

/// Opens a text file for reading by lines. UTF-16 is decoded; other encodings pass through, without a byte order mark (see `decode_name`).
pub fn open_lines(path: &Path) -> Result<TextInput> {
    let mut file = open_file(path)?;
    let head = read_head(&mut file).map_err(|e| Error::storage(path, e))?;
    let bom_encoding = Encoding::for_bom(&head).map(|(encoding, _)| encoding);
    if bom_encoding == Some(UTF_16LE) || bom_encoding == Some(UTF_16BE) {
        return Ok(decode(file, UTF_8));
    }
    if let Some(encoding) = detect_utf16_without_bom(&head) {
        return Ok(decode(file, encoding));
    }
    let mut input = BufReader::with_capacity(BUFFER_BYTES, file);
    if bom_encoding.is_some() {
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

fn decode(file: File, encoding: &'static Encoding) -> TextInput {
    let decoder = DecodeReaderBytesBuilder::new().encoding(Some(encoding)).bom_override(true).build(file);
    TextInput::Decoded(Box::new(BufReader::with_capacity(BUFFER_BYTES, decoder)))
}

/// Detects UTF-16 by its zeros: text of mostly ASCII characters has one in every other byte.
fn detect_utf16_without_bom(head: &[u8]) -> Option<&'static Encoding> {
    let pairs = head.as_chunks::<2>().0;
    let zeros = |k: usize| pairs.iter().filter(|p| p[k] == 0).count();
    let most = pairs.len() * 3 / 4;
    if pairs.len() < 2 || Encoding::for_bom(head).is_some() {
        None
    } else if zeros(1) > most && zeros(0) == 0 {
        Some(UTF_16LE)
    } else if zeros(0) > most && zeros(1) == 0 {
        Some(UTF_16BE)
    } else {
        None
    }
}

/// Returns the encoding that the XML declaration names.
fn parse_declared_encoding(head: &[u8]) -> Option<&'static Encoding> {
    let text = String::from_utf8_lossy(&head[..head.len().min(256)]);
    let declaration = &text[text.find("<?xml")?..text.find("?>")?];
    let value = declaration.split_once("encoding")?.1.trim_start().strip_prefix('=')?.trim_start();
    let quote = value.chars().next().filter(|c| "\"'".contains(*c))?;
    Encoding::for_label(value[1..].split(quote).next()?.as_bytes())
}
