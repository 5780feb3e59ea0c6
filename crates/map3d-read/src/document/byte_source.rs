//! The bytes of a document: a file as it is, or the content of a gzip file.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek};

use flate2::bufread::MultiGzDecoder;

const GZIP: [u8; 2] = [0x1f, 0x8b];

/// Reads a document from its first byte. A gzip file is unpacked as it is read.
pub enum ByteSource {
    File(File),
    Gzip(Box<GzipFile>),
}

/// A gzip file that is unpacked. `end`: number of unpacked bytes after which it ends; it is set when the rest is damaged.
pub struct GzipFile {
    decoder: MultiGzDecoder<BufReader<File>>,
    position: u64,
    end: Option<u64>,
}

impl ByteSource {
    pub fn new(mut file: File) -> io::Result<Self> {
        let mut magic = Vec::new();
        file.by_ref().take(GZIP.len() as u64).read_to_end(&mut magic)?;
        file.rewind()?;
        if magic != GZIP {
            return Ok(Self::File(file));
        }
        Ok(Self::Gzip(Box::new(GzipFile { decoder: MultiGzDecoder::new(BufReader::new(file)), position: 0, end: None })))
    }

    /// Goes back to the first byte.
    pub fn rewind(&mut self) -> io::Result<()> {
        match self {
            Self::File(file) => file.rewind(),
            Self::Gzip(gzip) => gzip.rewind(),
        }
    }

    pub fn is_gzip(&self) -> bool {
        matches!(self, Self::Gzip(_))
    }

    /// Makes a gzip file end where the last read failed. Returns the number of unpacked bytes until there.
    pub fn end_at_damage(&mut self) -> u64 {
        let Self::Gzip(gzip) = self else { return 0 };
        *gzip.end.insert(gzip.position)
    }
}

impl GzipFile {
    fn rewind(&mut self) -> io::Result<()> {
        let mut file = self.decoder.get_ref().get_ref().try_clone()?;
        file.rewind()?;
        (self.decoder, self.position) = (MultiGzDecoder::new(BufReader::new(file)), 0);
        Ok(())
    }
}

impl Read for GzipFile {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let room = self.end.map_or(out.len(), |end| out.len().min((end - self.position) as usize));
        if room == 0 {
            return Ok(0);
        }
        let damage = |e: io::Error| io::Error::new(e.kind(), format!("gzip file cut or damaged after {} unpacked bytes: {e}", self.position));
        let n = self.decoder.read(&mut out[..room]).map_err(damage)?;
        self.position += n as u64;
        Ok(n)
    }
}

impl Read for ByteSource {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::File(file) => file.read(out),
            Self::Gzip(gzip) => gzip.read(out),
        }
    }
}
