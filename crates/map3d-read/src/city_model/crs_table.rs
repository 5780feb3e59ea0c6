//! The coordinate systems that the elements of one document name. A number stands for each; equivalent spellings have one number.

use std::collections::HashMap;

use map3d_base::Vec3;
use twox_hash::XxHash3_64;

/// Index into the table.
pub type CrsNumber = u16;

/// The document's coordinate system: of elements that name none and are in none that does.
pub const DOCUMENT_CRS: CrsNumber = 0;

/// Stands for all beyond `MAX_SYSTEMS`; coordinates in them are skipped.
pub const TOO_MANY: CrsNumber = CrsNumber::MAX;
const MAX_SYSTEMS: usize = 32;
const MAX_NAME_CHARS: usize = 16_384;

pub struct CrsTable {
    /// As the document writes them; the first is `None` if the document names none.
    names: Vec<Option<String>>,
    numbers: HashMap<String, CrsNumber>,
    /// The name asked for last, and its number.
    last: Option<(String, CrsNumber)>,
}

impl CrsTable {
    /// `document`: the name of the document's coordinate system.
    pub fn new(document: Option<String>) -> Self {
        let numbers = document.iter().map(|name| (unify(name), DOCUMENT_CRS)).collect();
        Self { names: vec![document], numbers, last: None }
    }

    pub fn names(&self) -> &[Option<String>] {
        &self.names
    }

    /// Returns the number of a coordinate system; `None` if the name is empty.
    pub fn find(&mut self, name: &str) -> Option<CrsNumber> {
        let name = name.trim();
        if name.is_empty() {
            return None;
        }
        if let Some((_, number)) = self.last.as_ref().filter(|(last, _)| last == name) {
            return Some(*number);
        }
        let number = self.number_of(name.chars().take(MAX_NAME_CHARS).collect());
        self.last = Some((name.to_owned(), number));
        Some(number)
    }

    fn number_of(&mut self, name: String) -> CrsNumber {
        let unified = unify(&name);
        if let Some(number) = self.numbers.get(&unified) {
            return *number;
        }
        if self.names.len() >= MAX_SYSTEMS {
            return TOO_MANY;
        }
        let number = self.names.len() as CrsNumber;
        self.names.push(Some(name));
        self.numbers.insert(unified, number);
        number
    }
}

/// Stands for the horizontal part of a coordinate system; equivalent spellings have one key.
pub type HorizontalKey = u64;

pub fn horizontal_key(name: &str) -> HorizontalKey {
    let unified = unify(name);
    XxHash3_64::oneshot(unified.split(['+', '*']).next().unwrap_or_default().as_bytes())
}

/// Returns the same text for names that differ only in how they are written: the EPSG codes if there is nothing else, or the name itself.
fn unify(name: &str) -> String {
    let upper = name.trim().to_ascii_uppercase();
    find_epsg_codes(&upper).unwrap_or(upper)
}

/// Returns the codes of `EPSG:1+2`, `urn:ogc:def:crs,crs:EPSG::1,crs:EPSG::2`, `http://www.opengis.net/def/crs/EPSG/0/1` and the like.
fn find_epsg_codes(upper: &str) -> Option<String> {
    const WORDS: [&str; 14] =
        ["EPSG", "EPSG.XML", "URN", "X", "OGC", "DEF", "CRS", "COMPOUND", "HTTP", "HTTPS", "WWW.OPENGIS.NET", "OPENGIS.NET", "GML", "SRS"];
    const FIRST_CODE: u32 = 1000;
    let mut codes = Vec::new();
    for word in upper.split(|c: char| !c.is_ascii_alphanumeric() && c != '.').filter(|w| !w.is_empty()) {
        match word.parse::<u32>() {
            Ok(code) if code >= FIRST_CODE => codes.push(code.to_string()),
            // The version of the register, or the number of a part.
            Ok(_) => {}
            Err(_) if word.bytes().all(|b| b.is_ascii_digit() || b == b'.') => {}
            Err(_) if WORDS.contains(&word) => {}
            Err(_) => return None,
        }
    }
    (upper.contains("EPSG") && matches!(codes.len(), 1 | 2)).then(|| format!("EPSG:{}", codes.join("+")))
}

/// Returns the approximate metres per unit of each axis: geographic systems have degrees in the horizontal.
pub fn estimate_metres_per_unit(srs_name: Option<&str>) -> Vec3 {
    const METRES_PER_DEGREE: f64 = 111_320.0;
    if srs_name.is_some_and(is_geographic) { [METRES_PER_DEGREE, METRES_PER_DEGREE, 1.0] } else { [1.0; 3] }
}

/// Returns true for the EPSG codes of geographic systems: 4001 to 4999 without geocentric ones, and some newer codes; also for CRS84.
fn is_geographic(srs_name: &str) -> bool {
    const NEWER: [u32; 14] = [6318, 6319, 6668, 6697, 6783, 7843, 7844, 7912, 8999, 9000, 9057, 9755, 10_176, 10_299];
    const GEOCENTRIC: [u32; 6] = [4328, 4936, 4978, 4896, 4910, 4911];
    let code = srs_name.split(|c: char| !c.is_ascii_alphanumeric()).find_map(|word| word.parse::<u32>().ok().filter(|n| *n > 1000));
    let is_crs84 = srs_name.to_ascii_uppercase().contains("CRS84");
    is_crs84 || code.is_some_and(|code| NEWER.contains(&code) || ((4001..=4999).contains(&code) && !GEOCENTRIC.contains(&code)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equivalent_spellings_have_one_number() {
        let mut table = CrsTable::new(Some("EPSG:25832".into()));
        for name in [
            " epsg:25832 ",
            "EPSG::25832",
            "urn:ogc:def:crs:EPSG::25832",
            "urn:ogc:def:crs:EPSG:6.9:25832",
            "urn:x-ogc:def:crs:EPSG:25832",
            "http://www.opengis.net/def/crs/EPSG/0/25832",
            "https://www.opengis.net/def/crs/EPSG/9.9.1/25832",
            "http://www.opengis.net/gml/srs/epsg.xml#25832",
        ] {
            assert_eq!(table.find(name), Some(DOCUMENT_CRS), "{name}");
        }
        for name in [
            "EPSG:25832+5783",
            "urn:ogc:def:crs,crs:EPSG::25832,crs:EPSG::5783",
            "urn:ogc:def:crs,crs:EPSG:6.12:25832,crs:EPSG:6.12:5783",
            "http://www.opengis.net/def/crs-compound?1=http://www.opengis.net/def/crs/EPSG/0/25832&2=http://www.opengis.net/def/crs/EPSG/0/5783",
            "EPSG::25832*EPSG::5783",
        ] {
            assert_eq!(table.find(name), Some(1), "{name}");
        }
        let others = ["EPSG:25833", "urn:adv:crs:ETRS89_UTM32*DE_DHHN92_NH", "urn:ogc:def:crs:OGC:1.3:CRS84", "#local-25832", "25832"];
        assert_eq!(others.map(|name| table.find(name)), [Some(2), Some(3), Some(4), Some(5), Some(6)]);
        assert_eq!(table.find(" "), None);
        assert_eq!(table.names()[1].as_deref(), Some("EPSG:25832+5783"));
    }

    #[test]
    fn systems_that_differ_in_heights_have_one_horizontal_key() {
        let key = horizontal_key("EPSG:25832");
        for name in
            ["urn:ogc:def:crs,crs:EPSG:6.12:25832,crs:EPSG:6.12:5783", "EPSG::25832*EPSG::5783", "http://www.opengis.net/def/crs/EPSG/0/25832"]
        {
            assert_eq!(horizontal_key(name), key, "{name}");
        }
        assert_eq!(horizontal_key("urn:adv:crs:ETRS89_UTM32*DE_DHHN92_NH"), horizontal_key("urn:adv:crs:ETRS89_UTM32"));
        assert_ne!(horizontal_key("EPSG:25833"), key);
    }

    #[test]
    fn the_table_has_a_limit() {
        let mut table = CrsTable::new(None);
        let numbers: Vec<_> = (0..40).map(|k| table.find(&format!("EPSG:{}", 2000 + k))).collect();
        assert_eq!((numbers[30], numbers[31], numbers[39]), (Some(31), Some(TOO_MANY), Some(TOO_MANY)));
        assert_eq!((table.find("EPSG:2000"), table.names().len()), (Some(1), 32));
        assert_eq!(table.find(&"ä".repeat(5000)), Some(TOO_MANY));
    }

    #[test]
    fn geographic_systems_are_recognized_by_their_epsg_code() {
        for name in ["EPSG:4326", "http://www.opengis.net/def/crs/EPSG/0/6697", "urn:ogc:def:crs:EPSG::4979", "urn:ogc:def:crs:OGC:1.3:CRS84"] {
            assert!(is_geographic(name), "{name}");
        }
        for name in ["EPSG:25832+5783", "urn:adv:crs:DE_DHDN_3GK4*DE_DHN92_NH", "urn:ogc:def:crs,crs:EPSG:6.12:3068,crs:EPSG:6.12:5783", "EPSG:4978"]
        {
            assert!(!is_geographic(name), "{name}");
        }
    }
}
