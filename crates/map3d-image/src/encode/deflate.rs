//! Deflate, two ways: `Fast` for layers whose filtered bytes are mostly zeros, `Matching` where repeats pay.

/// Which deflate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Deflate {
    /// fdeflate: runs of zeros and a fixed code made for PNG.
    Fast,
    /// libdeflate level 1.
    Matching,
}

/// Compresses to zlib streams; keeps its buffers.
pub struct Deflater {
    matching: libdeflater::Compressor,
    out: Vec<u8>,
}

impl Default for Deflater {
    fn default() -> Self {
        let level = libdeflater::CompressionLvl::new(1).expect("1 is a level");
        Self { matching: libdeflater::Compressor::new(level), out: Vec::new() }
    }
}

impl Deflater {
    /// A zlib stream of `data`; valid until the next call.
    pub fn zlib(&mut self, data: &[u8], deflate: Deflate) -> &[u8] {
        match deflate {
            Deflate::Fast => {
                self.out.clear();
                let mut compressor = fdeflate::Compressor::new(&mut self.out).expect("memory");
                compressor.write_data(data).expect("memory");
                compressor.finish().expect("memory");
                &self.out
            }
            Deflate::Matching => {
                let bound = self.matching.zlib_compress_bound(data.len());
                self.out.resize(bound, 0);
                let n = self.matching.zlib_compress(data, &mut self.out).expect("the buffer is as large as the bound");
                &self.out[..n]
            }
        }
    }
}
