//! Decodes broken UTF-8 as it is read: bytes that are not UTF-8 are Windows-1252, and zero bytes are left out.

use std::io::{self, Read};

use encoding_rs::WINDOWS_1252;

const BUFFER_BYTES: usize = 1 << 16;

pub struct LossyUtf8<R> {
    source: R,
    raw: Vec<u8>,
    /// Bytes at the front of `raw` that may begin a character.
    kept: usize,
    decoded: Vec<u8>,
    at: usize,
}

impl<R: Read> LossyUtf8<R> {
    pub fn new(source: R) -> Self {
        Self { source, raw: vec![0; BUFFER_BYTES], kept: 0, decoded: Vec::new(), at: 0 }
    }

    /// Decodes more; returns false at the end.
    fn refill(&mut self) -> io::Result<bool> {
        let n = self.source.read(&mut self.raw[self.kept..])?;
        let end = self.kept + n;
        (self.at, self.kept) = (0, 0);
        self.decoded.clear();
        let mut start = 0;
        while start < end {
            let (valid, invalid) = match std::str::from_utf8(&self.raw[start..end]) {
                Ok(_) => (end - start, 0),
                Err(e) if e.error_len().is_none() && n > 0 => {
                    self.kept = end - start - e.valid_up_to();
                    (e.valid_up_to(), 0)
                }
                Err(e) => (e.valid_up_to(), e.error_len().unwrap_or(end - start - e.valid_up_to())),
            };
            self.decoded.extend(self.raw[start..start + valid].iter().filter(|byte| **byte != 0));
            let (letters, _) = WINDOWS_1252.decode_without_bom_handling(&self.raw[start + valid..start + valid + invalid]);
            self.decoded.extend_from_slice(letters.as_bytes());
            start += valid + invalid;
            if self.kept > 0 {
                break;
            }
        }
        self.raw.copy_within(end - self.kept..end, 0);
        Ok(n > 0 || end > 0)
    }
}

impl<R: Read> Read for LossyUtf8<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        while self.at == self.decoded.len() {
            if !self.refill()? {
                return Ok(0);
            }
        }
        let n = out.len().min(self.decoded.len() - self.at);
        out[..n].copy_from_slice(&self.decoded[self.at..self.at + n]);
        self.at += n;
        Ok(n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a few bytes at a time, so that characters are split.
    struct Pieces<'a>(&'a [u8], usize);

    impl Read for Pieces<'_> {
        fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
            let n = self.1.min(self.0.len()).min(out.len());
            out[..n].copy_from_slice(&self.0[..n]);
            self.0 = &self.0[n..];
            Ok(n)
        }
    }

    #[test]
    fn letters_of_both_encodings_are_kept_and_zeros_left_out() {
        let long = "Straße ".repeat(40_000);
        for (bytes, expected) in [
            (b"M\xfchle".to_vec(), "Mühle".to_owned()),
            ("M\u{fc}hle \u{1F3E0}\u{20ac}".as_bytes().to_vec(), "Mühle \u{1F3E0}\u{20ac}".to_owned()),
            ([b"\xc3\xbc \xfc ".as_slice(), b"\x80\0x\0"].concat(), "ü ü €x".to_owned()),
            (b"cut \xc3".to_vec(), "cut Ã".to_owned()),
            (b"\xf0\x9f".to_vec(), "ðŸ".to_owned()),
            (b"".to_vec(), String::new()),
            ([long.as_bytes(), b"\xe9"].concat(), long.clone() + "é"),
        ] {
            for size in [1, 2, 3, 1000, usize::MAX] {
                let mut text = String::new();
                LossyUtf8::new(Pieces(&bytes, size)).read_to_string(&mut text).expect("UTF-8");
                assert_eq!(text, expected, "{size} bytes at a time");
            }
        }
    }
}
