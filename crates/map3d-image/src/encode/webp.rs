//! Encodes lossy WebP with lossless alpha. The only file that calls libwebp.

use std::ffi::c_int;
use std::mem::MaybeUninit;

use libwebp_sys as ffi;
use map3d_base::{Error, Result};

use crate::raster::Raster;

/// libwebp's limit.
const MAX_SIDE_PX: u32 = 16_383;

/// libwebp's methods: 0 is the quickest; 5 and 6 save one per cent of the bytes for twice the time.
const QUICK: c_int = 0;
const SMALL: c_int = 4;

/// `quality` 1..=100.
pub fn encode_webp(image: &Raster, quality: u8, small: bool) -> Result<Vec<u8>> {
    if image.width == 0 || image.height == 0 || image.width.max(image.height) > MAX_SIDE_PX {
        return Err(Error::argument(format!("webp of {} × {} px, expected 1 to {MAX_SIDE_PX}", image.width, image.height)));
    }
    let config = config(quality, if small { SMALL } else { QUICK })?;
    let mut picture = WebpPicture::import(image)?;
    picture.encode(&config)
}

fn config(quality: u8, method: c_int) -> Result<ffi::WebPConfig> {
    let mut config = ffi::WebPConfig::new().map_err(|()| Error::argument("libwebp's version differs from its header's"))?;
    config.quality = f32::from(quality);
    config.method = method;
    config.exact = 1;
    // SAFETY: `config` is initialised; the call only reads it.
    match unsafe { ffi::WebPValidateConfig(&config) } {
        0 => Err(Error::argument(format!("webp quality {quality}"))),
        _ => Ok(config),
    }
}

/// Owns a libwebp picture and its planes.
struct WebpPicture(Box<ffi::WebPPicture>);

impl WebpPicture {
    fn import(image: &Raster) -> Result<Self> {
        let raw = ffi::WebPPicture::new().map_err(|()| Error::argument("libwebp's version differs from its header's"))?;
        let mut picture = Self(Box::new(raw));
        (picture.0.width, picture.0.height) = (image.width as c_int, image.height as c_int);
        let bytes = image.pixels.as_flattened().as_ptr();
        let stride = image.width as c_int * 4;
        // SAFETY: `bytes` points at height rows of stride bytes (Raster holds width · height pixels of four bytes), only read.
        let done = unsafe {
            match image.has_alpha() {
                true => ffi::WebPPictureImportRGBA(&mut *picture.0, bytes, stride),
                false => ffi::WebPPictureImportRGBX(&mut *picture.0, bytes, stride),
            }
        };
        if done == 0 { Err(picture.error()) } else { Ok(picture) }
    }

    fn encode(&mut self, config: &ffi::WebPConfig) -> Result<Vec<u8>> {
        let mut writer = MaybeUninit::<ffi::WebPMemoryWriter>::zeroed();
        // SAFETY: the writer lives until after its memory was copied and freed; WebPMemoryWrite is the writer function that goes with it.
        unsafe {
            ffi::WebPMemoryWriterInit(writer.as_mut_ptr());
            self.0.writer = Some(ffi::WebPMemoryWrite);
            self.0.custom_ptr = writer.as_mut_ptr().cast();
            let done = ffi::WebPEncode(config, &mut *self.0);
            let written = writer.assume_init_ref();
            let bytes = if done != 0 && !written.mem.is_null() { std::slice::from_raw_parts(written.mem, written.size).to_vec() } else { Vec::new() };
            ffi::WebPMemoryWriterClear(writer.as_mut_ptr());
            if done == 0 { Err(self.error()) } else { Ok(bytes) }
        }
    }

    fn error(&self) -> Error {
        Error::argument(format!("webp {} × {}: {:?}", self.0.width, self.0.height, self.0.error_code))
    }
}

impl Drop for WebpPicture {
    fn drop(&mut self) {
        // SAFETY: initialised by WebPPicture::new, freed once.
        unsafe { ffi::WebPPictureFree(&mut *self.0) }
    }
}
