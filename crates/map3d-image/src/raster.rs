//! Decoded images.

/// sRGB bytes with straight alpha, rows top to bottom.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Raster {
    pub width: u32,
    pub height: u32,
    /// `width · height` pixels: R, G, B, A.
    pub pixels: Vec<[u8; 4]>,
}

impl Raster {
    pub fn new(width: u32, height: u32, pixels: Vec<[u8; 4]>) -> Self {
        assert_eq!(pixels.len(), width as usize * height as usize, "{width} × {height} pixels");
        Self { width, height, pixels }
    }

    pub fn filled(width: u32, height: u32, pixel: [u8; 4]) -> Self {
        Self::new(width, height, vec![pixel; width as usize * height as usize])
    }

    pub fn row(&self, y: u32) -> &[[u8; 4]] {
        let w = self.width as usize;
        &self.pixels[y as usize * w..][..w]
    }

    pub fn has_alpha(&self) -> bool {
        self.pixels.iter().any(|p| p[3] != 255)
    }
}
