//! Three ways to deflate: `Fast` for layers whose filtered bytes are mostly zeros, `Matching` for layers with repeats, `Thorough` for fewest bytes.

/// A deflate method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Deflate {
    /// fdeflate: runs of zeros and a fixed code made for PNG.
    Fast,
    /// libdeflate level 1.
    Matching,
    /// libdeflate level 6. Level 9 saves a tenth of the bytes of depth layers, for four times the time.
    Thorough,
}

/// Compresses to zlib streams and reuses its buffers.
pub struct Deflater {
    matching: libdeflater::Compressor,
    thorough: Option<libdeflater::Compressor>,
    out: Vec<u8>,
}

impl Default for Deflater {
    fn default() -> Self {
        Self { matching: compressor(1), thorough: None, out: Vec::new() }
    }
}

impl Deflater {
    /// Returns a zlib stream of `data`, valid until the next call.
    pub fn zlib(&mut self, data: &[u8], deflate: Deflate) -> &[u8] {
        match deflate {
            Deflate::Fast => {
                self.out.clear();
                let mut compressor = fdeflate::Compressor::new(&mut self.out).expect("memory");
                compressor.write_data(data).expect("memory");
                compressor.finish().expect("memory");
                &self.out
            }
            Deflate::Matching => compress_with(&mut self.matching, data, &mut self.out),
            Deflate::Thorough => compress_with(self.thorough.get_or_insert_with(|| compressor(6)), data, &mut self.out),
        }
    }
}

fn compressor(level: i32) -> libdeflater::Compressor {
    libdeflater::Compressor::new(libdeflater::CompressionLvl::new(level).expect("a valid level"))
}

fn compress_with<'a>(compressor: &mut libdeflater::Compressor, data: &[u8], out: &'a mut Vec<u8>) -> &'a [u8] {
    out.resize(compressor.zlib_compress_bound(data.len()), 0);
    let n = compressor.zlib_compress(data, out).expect("the buffer is as large as the bound");
    &out[..n]
}
