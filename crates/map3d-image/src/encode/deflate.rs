//! Deflate, three ways: `Fast` for layers whose filtered bytes are mostly zeros, `Matching` where repeats pay, `Thorough` where bytes count.

/// Which deflate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Deflate {
    /// fdeflate: runs of zeros and a fixed code made for PNG.
    Fast,
    /// libdeflate level 1.
    Matching,
    /// libdeflate level 6: of depth 9 saves a tenth for four times the time.
    Thorough,
}

/// Compresses to zlib streams; keeps its buffers.
pub struct Deflater {
    matching: libdeflater::Compressor,
    thorough: Option<libdeflater::Compressor>,
    out: Vec<u8>,
}

impl Default for Deflater {
    fn default() -> Self {
        Self { matching: of_level(1), thorough: None, out: Vec::new() }
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
            Deflate::Matching => by_libdeflate(&mut self.matching, data, &mut self.out),
            Deflate::Thorough => by_libdeflate(self.thorough.get_or_insert_with(|| of_level(6)), data, &mut self.out),
        }
    }
}

fn of_level(level: i32) -> libdeflater::Compressor {
    libdeflater::Compressor::new(libdeflater::CompressionLvl::new(level).expect("a level"))
}

fn by_libdeflate<'a>(compressor: &mut libdeflater::Compressor, data: &[u8], out: &'a mut Vec<u8>) -> &'a [u8] {
    out.resize(compressor.zlib_compress_bound(data.len()), 0);
    let n = compressor.zlib_compress(data, out).expect("the buffer is as large as the bound");
    &out[..n]
}
