//! Reproducible random numbers.

pub struct Random(pub u64);

impl Random {
    fn advance(&mut self) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.0
    }

    /// Returns an integer below `n`; 0 if `n` is 0.
    pub fn below(&mut self, n: usize) -> usize {
        ((self.advance() >> 33) as usize) % n.max(1)
    }

    /// Returns a number in [0, 1).
    pub fn next_f64(&mut self) -> f64 {
        (self.advance() >> 11) as f64 / (1u64 << 53) as f64
    }
}
