//! Reads CityGML. `open` runs the first pass (`pre_scan`); this file is the second pass, which parses and converts one city object after another.

use std::path::Path;

use map3d_base::asset::{AssetReport, Batch, Instance, Material, Object};
use map3d_base::{Error, Result, Vec3};

use super::appearance::ThemeSelection;
use super::city_object::CityObject;
use super::city_object_parser::CityObjectParser;
use super::code_lists::CodeLists;
use super::converter::{FeatureConverter, INTERIOR_POLYGON};
use super::pre_scan::PreScan;
use super::tessellate::INVISIBLE_POLYGON;
use super::xml_reader::{Malformed, XmlEvent, XmlReader};
use crate::asset_folder::AssetFolder;
use crate::document::DocumentReader;
use crate::image_file::ImageFile;
use crate::options::ReadOptions;
use crate::report_builder::ReportBuilder;
use crate::text_input::count_lines;
use crate::transparency::report_invisible;

/// Reads CityGML. Memory: the results of the first pass (see `pre_scan`), one city object, and the tables of objects and materials.
pub struct CityGmlReader {
    xml: XmlReader,
    report: ReportBuilder,
    options: ReadOptions,
    srs_name: Option<String>,
    theme: ThemeSelection,
    /// The current city object.
    city_object: CityObject,
    converter: FeatureConverter,
    code_lists: CodeLists,
    instances: Vec<Instance>,
    /// Buffers for numbers and text.
    values: Vec<f64>,
    text: String,
    /// The root element was read.
    has_root: bool,
    at_end: bool,
    /// The document's transparency is opacity.
    inverted: bool,
}

impl CityGmlReader {
    /// Opens a document and runs the first pass. File names in the document are resolved inside its folder, or inside `options.folder`.
    pub fn open(path: &Path, options: &ReadOptions) -> Result<Self> {
        let lod = parse_lod(options)?;
        let folder = AssetFolder::for_document(path, options.folder.as_deref())?;
        let mut report = ReportBuilder::new(path, "citygml", options.strict);
        let PreScan { srs_name, theme, appearances, referenced_ids, transparency } = PreScan::run(path, options, &mut report)?;
        report.set_crs(srs_name.clone());
        report_theme(&theme, &mut report);
        let inverted = transparency.is_inverted(options.transparency, &mut report);
        let scale = estimate_metres_per_unit(srs_name.as_deref());
        Ok(Self {
            xml: XmlReader::open(path)?,
            report,
            options: options.clone(),
            srs_name,
            theme,
            city_object: CityObject::default(),
            converter: FeatureConverter::new(folder, options, inverted, scale, lod, appearances, referenced_ids),
            code_lists: CodeLists::new(AssetFolder::for_document(path, options.folder.as_deref())?),
            instances: Vec::new(),
            values: Vec::new(),
            text: String::new(),
            has_root: false,
            at_end: false,
            inverted,
        })
    }

    /// Reads the next child of the root element; converts the city objects in it. Returns false at the end of the document.
    fn read_member(&mut self) -> Result<bool> {
        while !self.has_root {
            match self.xml.next_event()? {
                XmlEvent::Start => self.has_root = true,
                XmlEvent::Eof => return Ok(false),
                XmlEvent::End | XmlEvent::Text => {}
            }
        }
        if !self.xml.next_child()? {
            return Ok(false);
        }
        match self.xml.local_name() {
            "cityObjectMember" | "featureMember" | "featureMembers" => {
                while self.xml.next_child()? {
                    self.read_city_object()?;
                }
            }
            _ => self.xml.skip()?,
        }
        Ok(true)
    }

    fn read_city_object(&mut self) -> Result<()> {
        self.city_object.clear();
        let parsed = CityObjectParser {
            xml: &mut self.xml,
            report: &mut self.report,
            options: &self.options,
            city_object: &mut self.city_object,
            theme: &mut self.theme,
            code_lists: &mut self.code_lists,
            values: &mut self.values,
            text: &mut self.text,
        }
        .read_city_object();
        // Of an object that the document breaks off in, the complete polygons are kept.
        let is_kept = match &parsed {
            Ok(()) => true,
            Err(_) => self.xml.is_malformed() && !self.options.strict && self.city_object.has_geometry(),
        };
        if is_kept {
            self.converter.convert(&mut self.city_object, &mut self.report)?;
        }
        parsed
    }

    /// Reports where the document breaks off.
    fn report_malformed(&mut self) {
        let Some(Malformed { byte, what }) = self.xml.malformed().cloned() else { return };
        let line = count_lines(self.report.path(), byte).map_or_else(|_| String::new(), |line| format!(", line {line}"));
        self.report.note_file("document broken", format!("at byte {byte}{line} ({what}); what comes before is kept"));
    }

    fn finish(&mut self) -> Result<()> {
        self.at_end = true;
        self.converter.convert_deferred(&mut self.report)?;
        self.instances = self.converter.finish_instances(&mut self.report)?;
        let interiors = self.report.skipped(INTERIOR_POLYGON);
        if interiors > 0 {
            self.report.note_file("polygons of interiors are not drawn", format!("{interiors}; --interiors draws them"));
        }
        report_invisible(self.report.skipped(INVISIBLE_POLYGON), self.inverted, &mut self.report);
        Ok(())
    }
}

fn parse_lod(options: &ReadOptions) -> Result<Option<u8>> {
    let Some(text) = &options.lod else { return Ok(None) };
    match text.as_bytes() {
        [digit @ b'0'..=b'4'] | [digit @ b'0'..=b'4', b'.', _] => Ok(Some(digit - b'0')),
        _ => Err(Error::argument(format!("lod {text:?}: expected 0, 1, 2, 3 or 4"))),
    }
}

fn report_theme(theme: &ThemeSelection, report: &mut ReportBuilder) {
    match (&theme.requested, theme.selected()) {
        (None, Some(selected)) if theme.has_several() => report.note("appearance theme used", selected),
        (Some(requested), _) if theme.first() != Some(requested) => {
            report.note("requested appearance theme is not the first in the document", requested.as_str());
        }
        _ => {}
    }
}

/// Returns the approximate metres per unit of each axis: geographic systems have degrees in the horizontal.
fn estimate_metres_per_unit(srs_name: Option<&str>) -> Vec3 {
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

impl DocumentReader for CityGmlReader {
    fn next_batch(&mut self) -> Result<Option<Batch>> {
        loop {
            if let Some(batch) = self.converter.batches.pop_front() {
                return Ok(Some(batch));
            }
            if self.at_end {
                return Ok(None);
            }
            match self.read_member() {
                Ok(true) => {}
                Ok(false) => self.finish()?,
                Err(_) if self.xml.is_malformed() && !self.options.strict => {
                    self.report_malformed();
                    self.finish()?;
                }
                Err(e) => return Err(e),
            }
        }
    }

    fn srs_name(&self) -> Option<&str> {
        self.srs_name.as_deref()
    }

    fn materials(&self) -> &[Material] {
        self.converter.resolver.table.materials()
    }

    fn objects(&self) -> &[Object] {
        &self.converter.objects
    }

    fn instances(&self) -> &[Instance] {
        &self.instances
    }

    fn instances_mut(&mut self) -> &mut [Instance] {
        &mut self.instances
    }

    fn textures(&self) -> &[ImageFile] {
        self.converter.resolver.images.files()
    }

    fn report(&self) -> &AssetReport {
        self.report.report()
    }
}

#[cfg(test)]
mod tests {
    use super::is_geographic;

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
