//! Options that only CityGML has.

use std::path::PathBuf;

use map3d_base::{Error, Result};
use serde::Deserialize;

use crate::city_model::lifespan::{Day, VersionDate};

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CityGmlOptions {
    /// Appearance theme; by default, the one with the most textures, of equal ones the first in the file.
    pub theme: Option<String>,
    /// Level of detail, 0 to 4; by default, the finest of each object.
    pub lod: Option<String>,
    /// Converts rooms and what is in them.
    pub interiors: bool,
    /// Converts the versions of features that exist on this day; by default, those that have not ended.
    pub at: Option<String>,
    /// The day that decides which versions have ended; by default, the present one.
    pub versions_on: Option<String>,
    /// Other files in the folder of the document whose appearances target surfaces of it.
    pub appearance_files: Vec<PathBuf>,
}

impl CityGmlOptions {
    /// Returns the date whose versions are converted.
    pub fn parse_date(&self) -> Result<VersionDate> {
        let parse =
            |name: &str, text: &str| Day::parse(text).ok_or_else(|| Error::argument(format!("{name} {text:?}: expected a date such as 2026-11-27")));
        Ok(match (&self.at, &self.versions_on) {
            (Some(text), _) => VersionDate::Requested(parse("at", text)?),
            (None, Some(text)) => VersionDate::Current(parse("versions_on", text)?),
            (None, None) => VersionDate::today(),
        })
    }

    /// Returns the requested level of detail.
    pub fn parse_lod(&self) -> Result<Option<u8>> {
        let Some(text) = &self.lod else { return Ok(None) };
        match text.as_bytes() {
            [digit @ b'0'..=b'4'] | [digit @ b'0'..=b'4', b'.', _] => Ok(Some(digit - b'0')),
            _ => Err(Error::argument(format!("lod {text:?}: expected 0, 1, 2, 3 or 4"))),
        }
    }
}
