//! The markers of a JPEG file: what its frame header says, and whether its scans are whole (ITU-T T.81, Annex B).

use memchr::memchr;

const START_OF_IMAGE: u8 = 0xD8;
const END_OF_IMAGE: u8 = 0xD9;
const START_OF_SCAN: u8 = 0xDA;
const APP0: u8 = 0xE0;
const APP14: u8 = 0xEE;

/// The colours of the components, by the rules of libjpeg (`default_decompress_parms`), which browsers follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JpegColor {
    Grey,
    YCbCr,
    Rgb,
    /// Four inks, inverted; the first three may be YCbCr.
    Inks,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JpegComponent {
    pub id: u8,
    /// Horizontal and vertical sampling factors.
    pub sampling: [u8; 2],
}

/// What a JPEG file says before its first scan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JpegHeader {
    pub width: u32,
    pub height: u32,
    /// Bits of a sample.
    pub precision: u8,
    /// Marker of the frame, which names the process of coding.
    frame: u8,
    pub components: Vec<JpegComponent>,
    has_jfif: bool,
    /// Colour transform that an Adobe marker names.
    pub adobe_transform: Option<u8>,
}

impl JpegHeader {
    /// Returns `None` if the file has no whole frame header.
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        let mut header: Option<Self> = None;
        let (mut has_jfif, mut adobe_transform) = (false, None);
        let mut at = 2;
        while let Some((marker, start)) = find_marker(bytes, at) {
            if matches!(marker, START_OF_SCAN | END_OF_IMAGE) {
                break;
            }
            if is_bare(marker) {
                at = start;
                continue;
            }
            let Some(segment) = segment(bytes, start) else { break };
            match marker {
                APP0 if segment.starts_with(b"JFIF\0") => has_jfif = true,
                APP14 if segment.len() >= 12 && segment.starts_with(b"Adobe") => adobe_transform = Some(segment[11]),
                _ if is_frame(marker) => header = Some(Self::parse_frame(marker, segment)?),
                _ => {}
            }
            at = start + 2 + segment.len();
        }
        header.map(|header| Self { has_jfif, adobe_transform, ..header })
    }

    fn parse_frame(frame: u8, segment: &[u8]) -> Option<Self> {
        let [precision, h1, h0, w1, w0, count, rest @ ..] = segment else { return None };
        let component = |c: &[u8; 3]| JpegComponent { id: c[0], sampling: [c[1] >> 4, c[1] & 15] };
        let components: Vec<JpegComponent> = rest.as_chunks::<3>().0.iter().take(usize::from(*count)).map(component).collect();
        (components.len() == usize::from(*count)).then(|| Self {
            width: u16::from_be_bytes([*w1, *w0]).into(),
            height: u16::from_be_bytes([*h1, *h0]).into(),
            precision: *precision,
            frame,
            components,
            has_jfif: false,
            adobe_transform: None,
        })
    }

    /// Names the kind of JPEG if it is one that is not read. Browsers do not show these kinds either.
    pub fn unread_kind(&self) -> Option<&'static str> {
        let sampling = |k: usize| self.components[k].sampling;
        match (self.frame, self.precision, self.components.len()) {
            (0xC3 | 0xC7 | 0xCB | 0xCF, ..) => Some("lossless JPEG"),
            (0xC5 | 0xC6 | 0xCD | 0xCE, ..) => Some("hierarchical JPEG"),
            (_, 12, _) => Some("12-bit JPEG"),
            (_, precision, _) if precision != 8 => Some("JPEG of another depth than 8 bits"),
            (_, _, 0 | 2 | 5..) => Some("JPEG with another number of components than 1, 3 or 4"),
            (_, _, 4) if sampling(3) != sampling(0) || sampling(2) != sampling(1) => Some("JPEG whose inks have several resolutions"),
            (_, _, 3) if self.color() == JpegColor::Rgb && (sampling(1) != sampling(0) || sampling(2) != sampling(0)) => {
                Some("RGB JPEG whose components have several resolutions")
            }
            _ => None,
        }
    }

    pub fn color(&self) -> JpegColor {
        let has_ids = |ids: &[u8]| self.components.iter().map(|c| c.id).eq(ids.iter().copied());
        match (self.components.len(), self.has_jfif, self.adobe_transform) {
            (1, ..) => JpegColor::Grey,
            (4, ..) => JpegColor::Inks,
            (_, false, Some(0)) => JpegColor::Rgb,
            (_, false, None) if has_ids(b"RGB") => JpegColor::Rgb,
            _ => JpegColor::YCbCr,
        }
    }
}

/// How markers and scans follow each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JpegStructure {
    /// Up to the end of the image.
    Whole,
    /// The file ends before its end mark: it is cut, or lacks nothing but the mark.
    WithoutEnd,
    /// Something in the coded pixels cannot be in them.
    BrokenScan,
}

/// Returns the structure of a file, by a search through its bytes; decodes nothing. Stray bytes between segments are no fault.
pub fn find_structure(bytes: &[u8]) -> JpegStructure {
    let (mut at, mut has_scan) = (2, false);
    while let Some((marker, start)) = find_marker(bytes, at) {
        match marker {
            END_OF_IMAGE if has_scan => return JpegStructure::Whole,
            END_OF_IMAGE => return JpegStructure::WithoutEnd,
            _ if has_scan && (is_bare(marker) || !is_known(marker)) => return JpegStructure::BrokenScan,
            _ if is_bare(marker) => at = start,
            _ => {
                let Some(segment) = segment(bytes, start) else { return JpegStructure::WithoutEnd };
                at = start + 2 + segment.len();
            }
        }
        if marker == START_OF_SCAN {
            has_scan = true;
            let Some(end) = find_scan_end(bytes, at) else { return JpegStructure::WithoutEnd };
            at = end;
        }
    }
    JpegStructure::WithoutEnd
}

/// Returns where the marker behind a scan is. Restart markers are part of the scan if they count from 0 to 7, again and again.
fn find_scan_end(bytes: &[u8], mut at: usize) -> Option<usize> {
    let mut restart = 0;
    loop {
        at += memchr(0xFF, bytes.get(at..)?)?;
        match *bytes.get(at + 1)? {
            0x00 => at += 2,
            0xFF => at += 1,
            marker if marker == 0xD0 + restart => {
                restart = (restart + 1) % 8;
                at += 2;
            }
            _ => return Some(at),
        }
    }
}

/// Returns the next marker from a place on, and the place behind it.
fn find_marker(bytes: &[u8], mut at: usize) -> Option<(u8, usize)> {
    loop {
        at += memchr(0xFF, bytes.get(at..)?)? + 1;
        match *bytes.get(at)? {
            0x00 | 0xFF => {}
            marker => return Some((marker, at + 1)),
        }
    }
}

/// Returns the content of a segment whose length is at a place.
fn segment(bytes: &[u8], start: usize) -> Option<&[u8]> {
    let length = u16::from_be_bytes([*bytes.get(start)?, *bytes.get(start + 1)?]);
    bytes.get(start + 2..start + usize::from(length.checked_sub(2)?) + 2)
}

/// Returns true for markers without a segment.
fn is_bare(marker: u8) -> bool {
    matches!(marker, 0x01 | 0xD0..=START_OF_IMAGE)
}

fn is_frame(marker: u8) -> bool {
    matches!(marker, 0xC0..=0xCF) && !matches!(marker, 0xC4 | 0xC8 | 0xCC)
}

fn is_known(marker: u8) -> bool {
    matches!(marker, 0xC0..=0xCF | START_OF_SCAN..=0xEF | 0xFE) && marker != 0xC8
}

#[cfg(test)]
mod tests {
    use super::*;

    const GREY: &[u8] = include_bytes!("../../tests/data/grey.jpg");
    const PROGRESSIVE: &[u8] = include_bytes!("../../tests/data/422-progressive.jpg");

    #[test]
    fn a_file_is_whole_up_to_its_end_mark_only() {
        for bytes in [GREY, PROGRESSIVE] {
            for whole in [bytes, &[bytes, &[0; 64]].concat()] {
                assert_eq!(find_structure(whole), JpegStructure::Whole);
            }
            assert!((0..bytes.len()).all(|end| find_structure(&bytes[..end]) == JpegStructure::WithoutEnd));
        }
    }

    #[test]
    fn foreign_markers_and_restarts_out_of_turn_show_damage() {
        let scan = GREY.len() - 40;
        for (marker, expected) in [
            (0x00, JpegStructure::Whole),
            (0xD0, JpegStructure::Whole),
            (0xD3, JpegStructure::BrokenScan),
            (0x55, JpegStructure::BrokenScan),
            (0xC0, JpegStructure::WithoutEnd),
        ] {
            let mut bytes = GREY.to_vec();
            bytes[scan..scan + 2].copy_from_slice(&[0xFF, marker]);
            assert_eq!(find_structure(&bytes), expected, "{marker:#x}");
        }
    }

    #[test]
    fn colours_follow_from_markers_and_component_ids() {
        let header = |ids: &[u8], has_jfif, adobe_transform| JpegHeader {
            width: 1,
            height: 1,
            precision: 8,
            frame: 0xC0,
            components: ids.iter().map(|id| JpegComponent { id: *id, sampling: [1, 1] }).collect(),
            has_jfif,
            adobe_transform,
        };
        for (ids, has_jfif, adobe, expected) in [
            (&b"\x01\x02\x03"[..], true, None, JpegColor::YCbCr),
            (b"\x01\x02\x03", false, Some(0), JpegColor::Rgb),
            (b"\x01\x02\x03", true, Some(0), JpegColor::YCbCr),
            (b"RGB", false, None, JpegColor::Rgb),
            (b"RGB", true, None, JpegColor::YCbCr),
            (b"RGB", false, Some(1), JpegColor::YCbCr),
            (b"\x00\x01\x02", false, None, JpegColor::YCbCr),
            (b"CMYK", false, None, JpegColor::Inks),
            (b"\x01", true, None, JpegColor::Grey),
        ] {
            assert_eq!(header(ids, has_jfif, adobe).color(), expected, "{ids:?} {has_jfif} {adobe:?}");
        }
    }
}
