//! Text of whatever encoding as UTF-8.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek};
use std::path::Path;

use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1252};
use encoding_rs_io::{DecodeReaderBytes, DecodeReaderBytesBuilder};
use map3d_base::{Error, Result};

const HEAD_BYTES: u64 = 4096;
const BUFFER_BYTES: usize = 1 << 17;

/// Text as it lies in a file, or decoded on the way.
pub enum Input {
    Plain(BufReader<File>),
    Decoded(Box<BufReader<DecodeReaderBytes<File, Vec<u8>>>>),
}

impl Read for Input {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Plain(input) => input.read(out),
            Self::Decoded(input) => input.read(out),
        }
    }
}

impl BufRead for Input {
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

/// A regular file, positioned at its start.
pub fn open_file(path: &Path) -> Result<File> {
    let file = File::open(path).map_err(|e| Error::storage(path, e))?;
    let is_file = file.metadata().map_err(|e| Error::storage(path, e))?.is_file();
    if is_file { Ok(file) } else { Err(Error::format(path, "not a regular file")) }
}

/// The first bytes of a file.
pub fn head(file: &mut File) -> io::Result<Vec<u8>> {
    let mut head = Vec::new();
    file.by_ref().take(HEAD_BYTES).read_to_end(&mut head)?;
    file.rewind()?;
    Ok(head)
}

/// An XML document as UTF-8, by its byte order mark or its declaration; bytes that make no sense there become U+FFFD.
pub fn open_xml(path: &Path) -> Result<Input> {
    let io = |e| Error::storage(path, e);
    let mut file = open_file(path)?;
    let head = head(&mut file).map_err(io)?;
    let encoding = utf16_without_mark(&head).or_else(|| declared_encoding(&head)).unwrap_or(UTF_8);
    if encoding == UTF_8 && Encoding::for_bom(&head).is_none() && is_utf8(&mut file).map_err(io)? {
        return Ok(Input::Plain(BufReader::with_capacity(BUFFER_BYTES, file)));
    }
    Ok(decoded(file, encoding))
}

/// Whether all of a file is UTF-8, and can be read without decoding; leaves it at its start.
fn is_utf8(file: &mut File) -> io::Result<bool> {
    let mut buffer = vec![0; BUFFER_BYTES];
    let mut kept = 0;
    let sound = loop {
        let n = file.read(&mut buffer[kept..])?;
        match std::str::from_utf8(&buffer[..kept + n]) {
            Ok(_) if n == 0 => break true,
            Ok(_) => kept = 0,
            // A character may be cut by the end of the buffer.
            Err(e) if e.error_len().is_none() && n > 0 => {
                buffer.copy_within(e.valid_up_to()..kept + n, 0);
                kept = kept + n - e.valid_up_to();
            }
            Err(_) => break false,
        }
    };
    file.rewind()?;
    Ok(sound)
}

/// Lines of text: UTF-16 is decoded, anything else is passed on as it is, without a byte order mark (see `name_of`).
pub fn open_lines(path: &Path) -> Result<Input> {
    let mut file = open_file(path)?;
    let head = head(&mut file).map_err(|e| Error::storage(path, e))?;
    let marked = Encoding::for_bom(&head).map(|(encoding, _)| encoding);
    if marked == Some(UTF_16LE) || marked == Some(UTF_16BE) {
        return Ok(decoded(file, UTF_8));
    }
    if let Some(encoding) = utf16_without_mark(&head) {
        return Ok(decoded(file, encoding));
    }
    let mut input = BufReader::with_capacity(BUFFER_BYTES, file);
    if marked.is_some() {
        input.fill_buf().map_err(|e| Error::storage(path, e))?;
        input.consume(3);
    }
    Ok(Input::Plain(input))
}

/// Bytes of a name: UTF-8, else as Western European text.
pub fn name_of(bytes: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => WINDOWS_1252.decode_without_bom_handling(bytes).0,
    }
}

fn decoded(file: File, encoding: &'static Encoding) -> Input {
    let decoder = DecodeReaderBytesBuilder::new().encoding(Some(encoding)).bom_override(true).build(file);
    Input::Decoded(Box::new(BufReader::with_capacity(BUFFER_BYTES, decoder)))
}

/// Text of mostly ASCII letters has a zero in every other byte.
fn utf16_without_mark(head: &[u8]) -> Option<&'static Encoding> {
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

fn declared_encoding(head: &[u8]) -> Option<&'static Encoding> {
    let text = String::from_utf8_lossy(&head[..head.len().min(256)]);
    let declaration = &text[text.find("<?xml")?..text.find("?>")?];
    let value = declaration.split_once("encoding")?.1.trim_start().strip_prefix('=')?.trim_start();
    let quote = value.chars().next().filter(|c| "\"'".contains(*c))?;
    Encoding::for_label(value[1..].split(quote).next()?.as_bytes())
}
