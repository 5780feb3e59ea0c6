//! One array of a G-buffer, of any type of pixels.

use map3d_base::layers::{Pixel, PixelType};

/// Pixels row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PixelArray {
    U8(Vec<u8>),
    U16(Vec<u16>),
    U32(Vec<u32>),
    I16x3(Vec<[i16; 3]>),
    U16x4(Vec<[u16; 4]>),
}

/// Evaluates an expression for the vector of an array, whatever its type.
macro_rules! each_type {
    ($array:expr, $pixels:ident => $value:expr) => {
        match $array {
            $crate::PixelArray::U8($pixels) => $value,
            $crate::PixelArray::U16($pixels) => $value,
            $crate::PixelArray::U32($pixels) => $value,
            $crate::PixelArray::I16x3($pixels) => $value,
            $crate::PixelArray::U16x4($pixels) => $value,
        }
    };
}

impl PixelArray {
    /// Returns `count` pixels whose channels are all `nothing`.
    pub fn new(pixel: PixelType, nothing: u32, count: usize) -> Self {
        match pixel {
            PixelType::U8 => Self::U8(vec![nothing as u8; count]),
            PixelType::U16 => Self::U16(vec![nothing as u16; count]),
            PixelType::U32 => Self::U32(vec![nothing; count]),
            PixelType::I16x3 => Self::I16x3(vec![[nothing as i16; 3]; count]),
            PixelType::U16x4 => Self::U16x4(vec![[nothing as u16; 4]; count]),
        }
    }

    /// Returns the number of pixels.
    pub fn len(&self) -> usize {
        each_type!(self, pixels => pixels.len())
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Drops all pixels and their memory.
    pub fn clear(&mut self) {
        each_type!(self, pixels => *pixels = Vec::new());
    }

    /// Returns the bytes as in memory.
    pub fn bytes(&self) -> &[u8] {
        each_type!(self, pixels => bytemuck::cast_slice(pixels))
    }

    pub fn bytes_mut(&mut self) -> &mut [u8] {
        each_type!(self, pixels => bytemuck::cast_slice_mut(pixels))
    }
}

/// A type of pixels that arrays have.
pub trait ArrayPixel: Pixel {
    /// Panics for an array of another type.
    fn slice(array: &PixelArray) -> &[Self];
    fn slice_mut(array: &mut PixelArray) -> &mut [Self];
}

macro_rules! array_pixel {
    ($type:ty, $variant:ident) => {
        impl ArrayPixel for $type {
            #[inline(always)]
            fn slice(array: &PixelArray) -> &[Self] {
                match array {
                    PixelArray::$variant(pixels) => pixels,
                    _ => wrong_type::<Self>(),
                }
            }

            #[inline(always)]
            fn slice_mut(array: &mut PixelArray) -> &mut [Self] {
                match array {
                    PixelArray::$variant(pixels) => pixels,
                    _ => wrong_type::<Self>(),
                }
            }
        }
    };
}

array_pixel!(u8, U8);
array_pixel!(u16, U16);
array_pixel!(u32, U32);
array_pixel!([i16; 3], I16x3);
array_pixel!([u16; 4], U16x4);

#[cold]
fn wrong_type<T: Pixel>() -> ! {
    panic!("an array whose pixels are not {:?}", T::TYPE)
}
